"""A free mass whose damping may be slow, in many digits."""

from decimal import Decimal, localcontext


def free_mass(rate, t, velocity, force):
    """eta, eta' of eta'' + rate eta' = force from rest at zero, in 60 digits."""
    with localcontext() as context:
        context.prec = 60
        d, time, v, p = (Decimal(float(x)) for x in (rate, t, velocity, force))
        if d == 0:
            return float(v * time + p * time**2 / 2), float(v + p * time)
        decay = (-d * time).exp()
        moved = (1 - decay) / d
        return float(v * moved + p * (time - moved) / d), float(v * decay + p * moved)
