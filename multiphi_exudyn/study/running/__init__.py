"""One run of one model of a scene: its histories and what it cost.

Order: files, environment, timing, energy_gain, runs, reduced_runner, body_runner, full_runner, craig_bampton_runner,
stepwise_runner, splitting_runner, runners, run_alone, needs.
"""
