"""Response: the motion of modal equations in closed form, free and forced, as sums of exponentials.

For matrices as NumPy has them, and in flat buffers for the loop of a run.

Order: exponentials, basis_arrays, free_response, light_damping, motion_parts, coupled_response, forced_response,
forced_orders, response_arrays, forced_arrays.
"""
