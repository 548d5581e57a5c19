"""A scene: its file, what it means as mechanics, and the bench on which its models are built.

Order: fields, places, toml_file, structure_tables, law_tables, load_tables, parts, model_kinds, scene_file,
scenes, file_reference, scene_loads, mechanics, discretised, workbench.
"""
