"""Conversion: an Exudyn system, or a finite element model in Exudyn, as a linear structure with contacts.

The system is linearised at its current state. Each of its items becomes a part of the matrices, a load or a contact, or
is left out for a stated reason. The system itself gives the error of the linearisation in a reduced motion.

Order: items, linearisation, contacts, structure, linear_range, reduction, reduce.
"""
