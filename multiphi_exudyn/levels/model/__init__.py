"""Model: a structure with its contacts, its number of modes, and the levels that it keeps.

Order: mode_choice, level_store, shared_base, model_arguments, model.
"""
