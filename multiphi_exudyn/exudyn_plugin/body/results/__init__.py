"""Results: motion, contact forces and deformed shape of a body, for sensors, histories and drawings.

Order: reconstruction, sensors, drawing.
"""
