"""What a reduced answer is compared with: the published rig, full models, closed forms.

Order: exudyn_quiet, rig, exact, bars, exact_beam, projection, global_basis, pod_basis, massless_boundary, spring_rule,
stepwise, craig_bampton, splitting, published_systems, beams, point_contact, rubbing, point_friction, point_law,
actions, craig_bampton_run, full_beam_settings, solver_settings, body_alone, full_matrices, laid_beam, beam_system,
drive, static_start, recorder, integration, histories, energy_history, full_run, full_beam, gentler,
extreme_case, extreme_cases.
"""
