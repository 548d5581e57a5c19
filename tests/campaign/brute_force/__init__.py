"""Brute force: a piecewise linear system under any loads, integrated level by level by matrix exponentials.

    M x'' + C x' + K x = sum_j p_j u_j(t) - M e z_b''(t) + sum_i h_i lambda_i,   g_i = h_i.x + gap_i - z_i(t)

    rigid      0 <= lambda, g >= 0, lambda g = 0, impacts by Moreau's law, plastic or with e
    compliant  lambda = k max(0, -g)
    viscous    lambda = max(0, -k g - c g') where g < 0
    law        -F(q) along p, F straight between knots and beyond them
    slider     -T along p, |T| <= F, T the way of a spring in series or a reaction; F constant or a share of a lambda

It shares no code with the package: matrices, rows and functions of time come in, motion goes out. The state
y = (x, x', J, T, s), J the impulses of the contacts, T the tensions of the sliders' springs, s the ways that they have
slid, is carried exactly over equal steps (loads by Gauss-Legendre quadrature); signs are looked at after every step,
dips between steps wherever three values in a row suggest one, and roots are found by bisection's faster kin. Impacts
and what closes after them are decided by trying every set of contacts, and with it whatever the sliders at rest may do,
stick or slip either way: the one whose motion stays admissible a moment later is right. Where several are, those stay
as they were that need not change.

Order: system, sliding, levels, instants, integration.
"""

from brute_force.integration import solved
from brute_force.levels import STEP
from brute_force.system import Answer, Course, Law, NoAnswer, Slider, Stop, System

__all__ = ["STEP", "Answer", "Course", "Law", "NoAnswer", "Slider", "Stop", "System", "solved"]
