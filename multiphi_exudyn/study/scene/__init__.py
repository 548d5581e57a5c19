"""A scene: its file, what it means as mechanics, and the setup on which its models are built.

Order: fields, places, toml_file, law_tables, load_tables, parts, structure_tables, model_kinds, scene_file,
scenes, file_reference, scene_loads, mechanics, discretised, workbench.
"""
