"""What the peers from PyPI are asked: the problems, their references, and what a peer cannot do.

Needs nothing but Python. The references of motion without a closed form are in references.json; the
file says how they were made (references.py).
"""
import json
import math
from pathlib import Path

GRAVITY, RESTITUTION, HEIGHT, IMPACTS, T_END = 9.81, 0.9, 10.0, 13, 20.5
HENON_HEILES = [0.0, 0.2587703282931232, -0.2525875586263492, -0.2178423952983717]
HENON_HEILES_END = 1000.0
LORENZ, LORENZ_END = [1.0, 1.0, 1.0], 10.0
# Of include/ricochet/systems/stick_slip.hpp, by Taylor series in arithmetic of 34 digits.
STICK_TIME, PERIOD = 4.2959995254801548834, 12.001031294830578647
STICK_SLIP_END = 10.5 * PERIOD
BALLS, BALLS_END = 1000, 15.0
ORBITS, ORBITS_END = 400, 100.0
FMU_END = 12.0
# Metres and metres a second that Box2D is made for: it has no restitution below 1 m/s.
DISCS, DISCS_BOX, DISCS_SPEED, DISCS_FILLING, DISCS_END = 1000, 50.0, 5.0, 0.3, 1.0


def fraction(k, ratio):
    """The k-th of a sequence that fills (0, 1) evenly; the same in every version of every library."""
    return (0.5 + k * ratio) % 1.0


def impact_times(height, restitution, until):
    """Of a ball that falls from rest: t1, then flights of 2 t1 e^k, summed without loss."""
    first = math.sqrt(2 * height / GRAVITY)
    terms, times = [first], [first]
    while times[-1] <= until:
        terms.append(2 * first * restitution ** len(terms))
        times.append(math.fsum(terms))
    return times[:-1]


def ball_table():
    """Heights [m] and restitutions of the balls of the ensemble."""
    return ([8 + 2 * fraction(k, 0.6180339887498949) for k in range(BALLS)],
            [0.85 + 0.1 * fraction(k, 0.4142135623730951) for k in range(BALLS)])


def orbit_table():
    """Starts of the 400 orbits of Henon and Heiles' star."""
    return [[-0.05, 0.1, 0.3, 0.0006 * k] for k in range(ORBITS)]


def disc_table():
    """Centres, velocities and the radius of the discs: a grid, in directions that fill the circle."""
    side = math.ceil(math.sqrt(DISCS))
    pitch = DISCS_BOX / side
    radius = DISCS_BOX * math.sqrt(DISCS_FILLING / (math.pi * DISCS))
    at = [((k % side + 0.5) * pitch, (k // side + 0.5) * pitch) for k in range(DISCS)]
    angles = [2 * math.pi * fraction(k, 0.6180339887498949) for k in range(DISCS)]
    return at, [(DISCS_SPEED * math.cos(a), DISCS_SPEED * math.sin(a)) for a in angles], radius


SPINNING = {"y": 0.5, "vx": 2.0, "spin": -30.0, "radius": 0.1, "restitution": 0.6, "friction": 0.2,
            "t_end": 1.0}


def spinning_disc():
    """(x, y, spin) of a solid disc thrown onto a rough floor, after `t_end`.

    At an impact the normal velocity turns with the restitution; the tangential impulse is Coulomb's,
    at most the friction times the normal one, and no more than what ends the slip u: m u / 3.
    """
    x, y, vx, vy = 0.0, SPINNING["y"], SPINNING["vx"], 0.0
    spin, radius, left = SPINNING["spin"], SPINNING["radius"], SPINNING["t_end"]
    while True:
        flight = (vy + math.sqrt(vy * vy + 2 * GRAVITY * (y - radius))) / GRAVITY
        if flight > left:
            return [x + vx * left, y + vy * left - GRAVITY * left * left / 2, spin]
        x, left, down = x + vx * flight, left - flight, GRAVITY * flight - vy
        y, vy = radius, SPINNING["restitution"] * down
        slip = vx + radius * spin
        most = SPINNING["friction"] * (1 + SPINNING["restitution"]) * down
        impulse = -math.copysign(min(most, abs(slip) / 3), slip)
        vx += impulse
        spin += 2 * impulse / radius


def ball_gradient():
    """Of the time of the last impact: by height, gravity and restitution."""
    first = math.sqrt(2 * HEIGHT / GRAVITY)
    last = first * (1 + 2 * math.fsum(RESTITUTION ** k for k in range(1, IMPACTS)))
    return [last / (2 * HEIGHT), -last / (2 * GRAVITY),
            2 * first * math.fsum(k * RESTITUTION ** (k - 1) for k in range(1, IMPACTS))]


def events(title, times, guards=None, **more):
    return {"title": title, "kind": "events", "times": times, "guards": guards or [0] * len(times),
            "samples": []} | more


def rows(title, counts, last):
    """Of an ensemble: how many events each run has, and the time of the last one."""
    return {"title": title, "kind": "rows", "counts": counts, "last": last}


def problems():
    """By name: title, kind and reference; the form is that of bench/report/score.py."""
    known = json.loads((Path(__file__).parent / "references.json").read_text())
    periods = range(11)
    slips = sorted([k * PERIOD for k in periods if k > 0] + [k * PERIOD + STICK_TIME for k in periods])
    heights, restitutions = ball_table()
    balls = [impact_times(h, e, BALLS_END) for h, e in zip(heights, restitutions)]
    return {
        "ball": events("Bouncing ball, 13 impacts", impact_times(HEIGHT, RESTITUTION, T_END)),
        "henon-heiles": events("Henon and Heiles' star to t = 1000, 153 crossings of x = 0",
                               known["henon-heiles"]),
        "lorenz": events("Lorenz' system to t = 10, crossings of z = 27", known["lorenz"]),
        "stick-slip": events("Stick and slip on a belt, 21 changes", slips),
        "balls": rows("1000 balls of one's own, each with its height and restitution, to 15 s",
                      [len(times) for times in balls], [times[-1] for times in balls]),
        "orbits": rows("400 orbits of Henon and Heiles' star to t = 100", **known["orbits"]),
        "gradient": {"title": "Time of the ball's 13th impact, and its derivatives by height, gravity and "
                              "restitution",
                     "kind": "values", "times": [], "guards": [], "samples": [ball_gradient()]},
        "discs": {"title": "1000 elastic discs in a box, one second", "kind": "bodies",
                  "contacts": known["discs"], "times": [], "guards": [], "samples": []},
        "spinning-disc": {"title": "A spinning disc thrown onto a rough floor: place and spin after 1 s",
                          "kind": "values", "times": [], "guards": [], "samples": [spinning_disc()]},
        "fmu-ball": events("Bouncing ball as an FMU, model exchange, to 12 s",
                           impact_times(HEIGHT, RESTITUTION, FMU_END)),
    }
