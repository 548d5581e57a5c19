"""Linear range: how far a reduced motion stays where its linearisation holds.

Order: range_check, linear_range.
"""
