"""Items: what each item of an Exudyn system becomes in a reduced model.

Order: directions, items, item_fates.
"""
