"""Trained networks."""

import os

from . import _ricochet
from ._guard_network import write_whole


class Network(_ricochet.Network):
    """A trained network, read from a model file.

    Calling it with features, an array ``(n,)`` or one row for each state, returns its outputs, one
    row for each state. The ``recipe`` determines the features: ``"state"`` is the state itself.
    Contiguous arrays of floats are not copied, the interpreter lock is not held, and threads may
    share a network.

    In a run it decides where guards are evaluated: ``integrate(system, x0, t_end, gate=network,
    detector="calibrated")``; instead of the network, its path may be given.

    Parameters
    ----------
    path : str or path-like
        A file written by ``ricochet train`` or by a training. A damaged or inconsistent file
        raises a ValueError.
    """

    def __init__(self, path):
        path = os.fspath(path)
        with open(path, "rb") as file:
            content = file.read()
        super().__init__(content, os.fsdecode(path))

    @classmethod
    def from_bytes(cls, content, name="bytes"):
        """The network in the contents of a file; ``name`` stands for the file in messages."""
        network = cls.__new__(cls)
        _ricochet.Network.__init__(network, content, name)
        return network

    def save(self, path):
        """Writes a model file. On failure, an existing file is unchanged."""
        write_whole(path, self.to_bytes())

    def __reduce__(self):
        return Network.from_bytes, (self.to_bytes(),)

    def __eq__(self, other):
        return isinstance(other, Network) and self.to_bytes() == other.to_bytes()

    __hash__ = None

    def __repr__(self):
        widths = "-".join(map(str, [self.inputs] + [bias.size for _, bias in self.layers]))
        return f"<Network: {self.kind} {widths} for {self.system or 'any system'}>"


def set_gate(options):
    """Replaces a path given as ``gate`` by the network in that file."""
    gate = options.get("gate")
    if gate is not None and not isinstance(gate, _ricochet.Network):
        if not isinstance(gate, (str, bytes, os.PathLike)):
            raise TypeError(f"gate: found a {type(gate).__name__}, expected a Network or the path "
                            "of a model")
        options["gate"] = Network(gate)
