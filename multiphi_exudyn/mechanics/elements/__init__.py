"""Elements: contacts, friction and force laws as elements with states.

Order: element, contact, friction, law_lines, force_law, element_table.
"""
