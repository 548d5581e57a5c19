"""One run of one model of a scene: its histories and what it cost.

Order: environment, timing, runs, runner, reduced_runner, body_runner, full_runner, craig_bampton_runner,
stepwise_runner, runners, run_alone, needs.
"""
