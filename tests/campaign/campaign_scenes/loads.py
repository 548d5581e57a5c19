"""Random loads and motions of stops and bases, the same in the words of the package and of brute force."""

import math
from dataclasses import fields, replace

import brute_force as bf
import numpy as np
import scipy.linalg

import multiphi_exudyn as mp
from campaign_scenes.parts import random_row

NARROWEST = 1e-5  # of the run: a load of one peak


def _frequencies(parts):
    """[Hz] of the open structure and of it with one contact closed."""
    found = []
    for extra in (None, *parts.stops):
        stiff = parts.stiffness
        if extra is not None and np.isfinite(extra.stiffness):
            stiff = stiff + extra.stiffness * np.outer(extra.row, extra.row)
        square = scipy.linalg.eigh(stiff, parts.mass, eigvals_only=True)
        found += [math.sqrt(s) / (2 * math.pi) for s in square if s > 1e-6]
    return found or [0.5]


def random_wave(parts, amplitude, frequency=None):
    """A harmonic course, the same in both worlds; resonant ones among them."""
    random = parts.random
    if frequency is None:
        resonant = random.random() < 0.4
        frequency = float(random.choice(_frequencies(parts))) if resonant else float(10.0 ** random.uniform(-1, 0.7))
    phase = float(random.choice([0.0, -math.pi / 2, random.uniform(0, 6)]))
    omega = 2 * math.pi * frequency
    course = bf.Course(
        lambda t: amplitude * np.cos(omega * t + phase),
        lambda t: -amplitude * omega * np.sin(omega * t + phase),
        lambda t: -amplitude * omega**2 * np.cos(omega * t + phase),
        step=bf.STEP / omega,
    )
    return (amplitude, frequency, phase), course


def random_strength(parts):
    """[N] of a load that moves the structure by a few of its gaps."""
    return float(10.0 ** parts.random.uniform(0, 1.2))


def add_harmonic_load(parts):
    row, (numbers, course) = random_row(parts), random_wave(parts, random_strength(parts))
    parts.load(row, mp.HarmonicLoad(row, *numbers), course)


def add_constant_load(parts, strength=None):
    row = random_row(parts)
    force = float((strength or 5.0) * parts.random.normal())
    parts.loads.append(mp.ConstantLoad(row, force))
    parts.constant = parts.constant + force * row


def add_gravity(parts):
    row, g = np.sign(parts.random.normal(size=parts.n)), 9.81 * float(parts.random.choice([-1, 1, 0.1]))
    parts.loads.append(mp.Gravity(row, g))
    parts.constant = parts.constant + g * (parts.mass @ row)


def _samples(parts, end):
    """Times and values: few or thousands, steps, a start or an end inside the run."""
    random, kind = parts.random, str(parts.random.choice(["few", "many", "thousands", "steps", "window"]))
    if kind == "few":
        time = np.r_[0.0, np.sort(random.uniform(0, end, int(random.integers(1, 12)))), 1.1 * end]
        return time, random.normal(size=len(time))
    if kind == "steps":
        jumps, width = np.sort(random.uniform(0.05, 0.9, int(random.integers(1, 5)))) * end, 1e-6 * end
        jumps = jumps[np.r_[True, np.diff(jumps) > 2 * width]]
        values = random.normal(size=len(jumps) + 1)
        return np.r_[0.0, np.c_[jumps, jumps + width].ravel(), 2 * end], np.repeat(values, 2)
    first, last = (0.2 * end, 0.7 * end) if kind == "window" else (0.0, end)
    count = {"many": 200, "thousands": 3000, "window": 50}[kind]
    time = np.linspace(first, last, count)
    omega = 2 * math.pi * float(random.uniform(0.2, 1.5))
    return time, np.sin(omega * time + random.uniform(0, 6)) + 0.05 * random.normal(size=count)


def add_sampled_load(parts):
    row, size = random_row(parts), random_strength(parts)
    time, values = _samples(parts, parts.end)
    values = size * values
    course = bf.Course(lambda t: np.interp(t, time, values, left=0.0, right=0.0), breaks=tuple(time))
    parts.load(row, mp.SampledLoad(row, time, values), course)


def add_function_load(parts):
    row, size, end = random_row(parts), random_strength(parts), parts.end
    random = parts.random
    kind = str(random.choice(["narrow", "peaks", "stepped", "smooth", "smooth"]))
    if kind == "stepped":
        at = float(random.uniform(0.1, 0.9)) * end
        more = {"breaks": (at,)} if "breaks" in {f.name for f in fields(mp.FunctionLoad)} else {}
        load = mp.FunctionLoad(row, lambda t: size if t < at else 0.0, **more)
        parts.load(row, load, bf.Course(lambda t: np.where(t < at, size, 0.0), breaks=(at,)))
        return
    if kind == "smooth":
        a, b, c = random.uniform(0.5, 8), random.uniform(0, 6), random.uniform(0, 1.0)
        parts.load(
            row,
            mp.FunctionLoad(row, lambda t: size * np.sin(a * t + b) * np.exp(-c * t)),
            bf.Course(lambda t: size * np.sin(a * t + b) * np.exp(-c * t), step=bf.STEP / (a + c)),
        )
        return
    places = random.uniform(0.05, 0.8, 1 if kind == "narrow" else 3) * end
    width = end * 10.0 ** random.uniform(math.log10(NARROWEST), -1.5)
    size *= min(0.3 / width, 1e3) * 0.3

    def pulses(t):
        return sum(size * np.exp(-0.5 * ((t - place) / width) ** 2) for place in places)

    fine = tuple((place - 9 * width, place + 9 * width, width) for place in places)
    parts.load(row, mp.FunctionLoad(row, pulses), bf.Course(pulses, fine=fine))


def random_sweep(parts, amplitude, end):
    random = parts.random
    first, last = 10.0 ** random.uniform(-0.7, 0.8, 2)
    duration = end * float(random.choice([0.6, 1.0, 1.3]))
    law = str(random.choice(["linear", "logarithmic"]))
    octaves = math.log(last / first)
    slope = (last - first) / duration

    def hertz(t):
        return first + slope * t if law == "linear" else first * np.exp(octaves * t / duration)

    def phase(t):
        if law == "linear":
            return 2 * math.pi * (first * t + slope * t**2 / 2)
        return 2 * math.pi * first * duration / octaves * (np.exp(octaves * t / duration) - 1)

    def rising(t):
        return slope if law == "linear" else hertz(t) * octaves / duration

    def on(t):
        return t <= duration

    def value(t):
        return np.where(on(t), amplitude * np.cos(phase(t)), 0.0)

    def rate(t):
        return np.where(on(t), -amplitude * 2 * math.pi * hertz(t) * np.sin(phase(t)), 0.0)

    def acceleration(t):
        omega, change = 2 * math.pi * hertz(t), 2 * math.pi * rising(t)
        return np.where(on(t), -amplitude * (omega**2 * np.cos(phase(t)) + change * np.sin(phase(t))), 0.0)

    course = bf.Course(value, rate, acceleration, breaks=(duration,), step=bf.STEP / (2 * math.pi * max(first, last)))
    return (amplitude, float(first), float(last), duration, law), course


def add_sweep_load(parts):
    row = random_row(parts)
    numbers, course = random_sweep(parts, random_strength(parts), parts.end)
    parts.load(row, mp.SweepLoad(row, *numbers), course)


def random_way(parts, amplitude, *, whole=True):
    """(course of the package, course) of a stop or a base; whole: it lasts, so that its speed never jumps."""
    kind = str(parts.random.choice(["harmonic", "harmonic", "smooth", "sweep"]))
    if kind == "harmonic":
        numbers, course = random_wave(parts, amplitude, float(10.0 ** parts.random.uniform(-1, 0.4)))
        return mp.Harmonic(*numbers), course
    if kind == "sweep":
        numbers, course = random_sweep(parts, amplitude, 2.2 * parts.end if whole else parts.end)
        return mp.Sweep(*numbers), course
    a, b = parts.random.uniform(0.5, 5, 2)
    made = mp.Smooth(lambda t: amplitude * np.sin(a * t) * np.cos(b * t))
    course = bf.Course(
        lambda t: amplitude * np.sin(a * t) * np.cos(b * t),
        lambda t: amplitude * (a * np.cos(a * t) * np.cos(b * t) - b * np.sin(a * t) * np.sin(b * t)),
        lambda t: (
            -amplitude * ((a**2 + b**2) * np.sin(a * t) * np.cos(b * t) + 2 * a * b * np.cos(a * t) * np.sin(b * t))
        ),
        step=bf.STEP / (a + b),
    )
    return made, course


def scaled_course(course, factor):
    return replace(
        course,
        value=lambda t: factor * course.value(t),
        rate=lambda t: factor * course.rate(t),
        acceleration=lambda t: factor * course.acceleration(t),
    )
