"""Contacts: contacts, stops and friction of an Exudyn system, and the rows of its points.

Order: point_rows, moved_directions, frictions, contacts.
"""
