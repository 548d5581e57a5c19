"""All answers of Coulomb's law to an impact: one if no determinant is negative, three to some speeds if one is."""

import itertools

import numpy as np
import pytest

from multiphi_exudyn.mathematics.coulomb_impacts import CoulombImpact


def drawn(seed, contacts, largest):
    random = np.random.default_rng(seed)
    rows = random.normal(size=(contacts, 2, 2 * contacts + 1))
    return CoulombImpact(rows, random.uniform(0, largest, contacts)), random


def admissible(impact, random):
    """Speeds before an impact (k, 2) that some impulses bring to admissible ones, in turn of every kind of piece."""
    flat = impact.rows.reshape(-1, impact.rows.shape[-1])
    for states in itertools.product(("open", "stick", 1, -1), repeat=len(impact.ratios)):
        impulses, after = np.zeros((2, *impact.rows.shape[:2]))
        for k, state in enumerate(states):
            if state == "open":
                after[k] = random.uniform(0, 1), random.normal()
                continue
            impulses[k, 0] = random.uniform(0, 1)
            limit = impact.ratios[k] * impulses[k, 0]
            impulses[k, 1] = random.uniform(-limit, limit) if state == "stick" else -state * limit
            after[k, 1] = 0.0 if state == "stick" else state * random.uniform(0, 1)
        yield after - (flat @ flat.T @ impulses.ravel()).reshape(after.shape)


@pytest.mark.parametrize("contacts", [1, 2, 3])
@pytest.mark.parametrize("largest", [0.1, 2.0])
def test_there_is_one_answer_exactly_where_it_is_called_unique(contacts, largest):
    kinds = set()
    for seed in range(20):
        impact, random = drawn(seed, contacts, largest)
        counts = [impact.answers(speeds) for speeds in admissible(impact, random)]
        assert all(count % 2 == 1 for count in counts)
        assert impact.is_unique == (max(counts) == 1)
        kinds.add(impact.is_unique)
    assert True in kinds
    assert (False in kinds) == (largest > 1)


@pytest.mark.parametrize("coefficient", [1.24, 1.26])
def test_of_one_contact_is_the_condition_of_sliding(coefficient):
    """h_n.M^-1 (h_n - s mu h_t) = (1 - 0.8 mu) / 0.36."""
    rows = np.linalg.cholesky(np.linalg.inv([[1.0, 0.8], [0.8, 1.0]]))[None, ::-1]
    assert CoulombImpact(rows, np.array([coefficient])).is_unique == (coefficient < 1.25)


@pytest.mark.parametrize(("coefficient", "sure"), [(0.1, True), (2.0, False)])
def test_of_many_contacts_is_unique_where_that_is_sure(coefficient, sure):
    """Seven that do not push each other, each with W = 1 and 0.5 beside it: sure below 1 / sqrt 2."""
    rows = np.kron(np.eye(7), np.linalg.cholesky([[1.0, 0.5], [0.5, 1.0]]))
    impact = CoulombImpact(rows.reshape(7, 2, 14), np.full(7, coefficient))
    assert not impact.tried
    assert impact.is_unique == sure
