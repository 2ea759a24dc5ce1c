"""Engines of bodies by steps of constant length: pymunk, Box2D, MuJoCo.

Each run sets the places and velocities back, and is stepped; contacts and overlaps are taken in a run
of their own. Elasticity 1 and no friction, steps and iterations as in the engines' manuals.
"""
import sys

import numpy as np

import bodies
import problems
from cell import main, values, version

RADIUS = bodies.TABLE[2]


def steps(dt, t_end):
    return round(t_end / dt)


class Pymunk:
    def __init__(self, dt):
        import pymunk
        self.dt, self.space, self.contacts, self.bodies = dt, pymunk.Space(), 0, []
        for a, b in bodies.WALLS:
            wall = pymunk.Segment(self.space.static_body, a, b, 0.0)
            wall.elasticity, wall.friction = 1.0, 0.0
            self.space.add(wall)
        for _ in bodies.TABLE[0]:
            body = pymunk.Body(1.0, RADIUS**2 / 2)
            shape = pymunk.Circle(body, RADIUS)
            shape.elasticity, shape.friction = 1.0, 0.0
            self.space.add(body, shape)
            self.bodies.append(body)

    def reset(self):
        for body, at, velocity in zip(self.bodies, *bodies.TABLE[:2]):
            body.position, body.velocity, body.angular_velocity = at, velocity, 0.0

    def step(self):
        self.space.step(self.dt)

    def count(self):
        def begin(arbiter, space, data):
            self.contacts += 1
        self.space.on_collision(None, None, begin=begin)

    def places(self):
        return np.array([body.position for body in self.bodies])

    def velocities(self):
        return np.array([body.velocity for body in self.bodies])


class Box2D:
    def __init__(self, dt):
        import Box2D as b2
        self.b2, self.dt, self.contacts = b2, dt, 0
        self.world = b2.b2World(gravity=(0, 0), doSleep=False)
        self.world.CreateStaticBody(fixtures=[
            b2.b2FixtureDef(shape=b2.b2EdgeShape(vertices=[a, b]), friction=0, restitution=1)
            for a, b in bodies.WALLS])
        disc = b2.b2FixtureDef(shape=b2.b2CircleShape(radius=RADIUS), density=1, friction=0, restitution=1)
        self.bodies = [self.world.CreateDynamicBody(position=at, fixtures=disc) for at in bodies.TABLE[0]]

    def reset(self):
        for body, at, velocity in zip(self.bodies, *bodies.TABLE[:2]):
            body.position, body.linearVelocity, body.angularVelocity = at, velocity, 0.0

    def step(self):
        self.world.Step(self.dt, 8, 3)

    def count(self):
        engine = self

        class Listener(self.b2.b2ContactListener):
            def BeginContact(self, contact):
                engine.contacts += 1
        self.listener = Listener()
        self.world.contactListener = self.listener

    def places(self):
        return np.array([tuple(body.position) for body in self.bodies])

    def velocities(self):
        return np.array([tuple(body.linearVelocity) for body in self.bodies])


class MuJoCo:
    """Discs are spheres on two slides; undamped contacts of a stiffness that a step can follow."""

    def __init__(self, dt):
        import mujoco
        self.mujoco, self.contacts, self.before = mujoco, None, set()
        size = problems.DISCS_BOX
        contact = 'solref="-20000 0" solimp="0.95 0.99 0.001"'
        walls = "".join(f'<geom type="plane" size="0 0 1" pos="{x} {y} 0" zaxis="{a} {b} 0" {contact}/>'
                        for x, y, a, b in ((0, 0, 0, 1), (0, 0, 1, 0), (size, size, 0, -1), (size, size, -1, 0)))
        disc = (f'<joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 1 0"/>'
                f'<geom type="sphere" size="{RADIUS}" mass="1" condim="1" {contact}/>')
        moving = "".join(f'<body pos="{x} {y} 0">{disc}</body>' for x, y in bodies.TABLE[0])
        self.model = mujoco.MjModel.from_xml_string(
            f'<mujoco><option timestep="{dt}" gravity="0 0 0"/><size memory="200M"/>'
            f'<worldbody>{walls}{moving}</worldbody></mujoco>')
        self.data = mujoco.MjData(self.model)
        self.start = np.array(bodies.TABLE[0])

    def reset(self):
        self.mujoco.mj_resetData(self.model, self.data)
        self.data.qvel[:] = np.ravel(bodies.TABLE[1])

    def step(self):
        self.mujoco.mj_step(self.model, self.data)
        if self.contacts is not None:
            now = set(map(tuple, self.data.contact.geom[:self.data.ncon].tolist()))
            self.contacts += len(now - self.before)
            self.before = now

    def count(self):
        self.contacts = 0

    def places(self):
        return self.start + self.data.qpos.reshape(-1, 2)

    def velocities(self):
        return self.data.qvel.reshape(-1, 2)


def discs(engine, dt):
    def make():
        world = engine(dt)

        def solve():
            world.reset()
            for _ in range(steps(dt, problems.DISCS_END)):
                world.step()

        def read(_):
            seen = engine(dt)
            seen.reset()
            seen.count()
            deepest = 0.0
            for _ in range(steps(dt, problems.DISCS_END)):
                seen.step()
                deepest = max(deepest, bodies.overlap(seen.places()))
            return bodies.answer(seen.contacts, deepest, seen.velocities())
        return solve, read
    return make


def spinning_pymunk(dt):
    """A contact of pymunk has the product of both elasticities, and of both frictions."""
    def make():
        import pymunk
        thrown = problems.SPINNING
        space = pymunk.Space()
        space.gravity = (0, -problems.GRAVITY)
        floor = pymunk.Segment(space.static_body, (-100, 0), (100, 0), 0.0)
        floor.elasticity, floor.friction = 1.0, 1.0
        body = pymunk.Body(1.0, thrown["radius"] ** 2 / 2)
        shape = pymunk.Circle(body, thrown["radius"])
        shape.elasticity, shape.friction = thrown["restitution"], thrown["friction"]
        space.add(floor, body, shape)

        def solve():
            body.position, body.velocity = (0, thrown["y"]), (thrown["vx"], 0)
            body.angular_velocity = thrown["spin"]
            for _ in range(steps(dt, thrown["t_end"])):
                space.step(dt)
            return [*body.position, body.angular_velocity]
        return solve, values
    return make


def spinning_box2d(dt):
    """A contact of Box2D has the larger restitution, and the geometric mean of both frictions."""
    def make():
        import Box2D as b2
        thrown = problems.SPINNING
        world = b2.b2World(gravity=(0, -problems.GRAVITY))
        world.CreateStaticBody(fixtures=b2.b2FixtureDef(
            shape=b2.b2EdgeShape(vertices=[(-100, 0), (100, 0)]), friction=thrown["friction"]))
        body = world.CreateDynamicBody(allowSleep=False, fixtures=b2.b2FixtureDef(
            shape=b2.b2CircleShape(radius=thrown["radius"]), density=1, friction=thrown["friction"],
            restitution=thrown["restitution"]))

        def solve():
            body.position, body.linearVelocity = (0, thrown["y"]), (thrown["vx"], 0)
            body.angularVelocity = thrown["spin"]
            for _ in range(steps(dt, thrown["t_end"])):
                world.Step(dt, 8, 3)
            return [*body.position, body.angularVelocity]
        return solve, values
    return make


def cells():
    out = [("discs", peer, "step", dt, discs(engine, dt))
           for peer, engine, all_dt in (("pymunk", Pymunk, (1 / 60, 1 / 240, 1 / 1000)),
                                        ("Box2D", Box2D, (1 / 60, 1 / 240, 1 / 1000)),
                                        ("MuJoCo", MuJoCo, (1 / 500, 1 / 2000)))
           for dt in all_dt]
    out += [("spinning-disc", peer, "step", dt, thrown(dt))
            for peer, thrown in (("pymunk", spinning_pymunk), ("Box2D", spinning_box2d))
            for dt in (1 / 60, 1 / 1000, 1 / 10000)]
    return out


PACKAGES = {"pymunk": "pymunk", "Box2D": "Box2D", "MuJoCo": "mujoco"}

if __name__ == "__main__":
    sys.exit(main({peer: version(package) for peer, package in PACKAGES.items()}, cells()))
