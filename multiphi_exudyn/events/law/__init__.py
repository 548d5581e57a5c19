"""Law of events: its twelve sentences, stated in decision.py, and the functions that implement them.

Order: impact_round_off, impact, phases, changes, redundancy, bounces, rebounds, resting, striking, switching,
friction_problem, sticking, decision, monitoring, first_state.
"""
