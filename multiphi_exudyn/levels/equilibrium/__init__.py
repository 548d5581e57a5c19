"""Equilibrium: a structure at rest under forces, with contacts, force laws and friction.

Order: sliding_equilibrium, static_equilibrium, equilibrium_on_contacts, equilibrium_under_forces.
"""
