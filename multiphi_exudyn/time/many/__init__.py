"""Many runs of one model that differ in their starts, on all cores.

Order: workers, many.
"""
