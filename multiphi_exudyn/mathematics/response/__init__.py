"""Response: the motion of modal equations in closed form, free and forced, as sums of exponentials.

For matrices as NumPy has them, and in flat buffers for the loop of a run.

Order: exponentials, basis_arrays, light_damping, free_response, motion_parts, coupled_response, forced_response,
forced_orders, response_arrays, forced_arrays.
"""
