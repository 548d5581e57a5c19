"""States in flat arrays: their flow (38.3), signals and energies, and how a map moves them (38.6).

Order: state_arrays, signals, maps, defect_sums, energies, channel_values, flow, signal_flow.
"""
