"""What a reduced answer is compared with: the published rig, full models, closed forms."""
