"""Functions of time: their jumps and kinks, and what they are as pieces of polynomials, carriers and straight lines.

Order: corners, interpolation, piecewise_exponential, piecewise_linear_fit.
"""
