"""Packing: levels, maps, channels and starts of a run, written into the flat arrays that the loop works on.

Order: channel_arrays, element_arrays, scratch_arrays, level_parts, level_writing, level_records, level_tables,
level_arrays, start_arrays.
"""
