"""Trained networks."""

import os

from . import _ricochet


class Network(_ricochet.Network):
    """A trained network, read from a model file.

    Called with features, ``(n,)`` or one row for each state, it gives its outputs, one row of them
    for each. What the features are made of is its ``recipe``: ``"state"`` is the state itself.
    Contiguous arrays of floats are read where they lie, without the interpreter lock, and threads
    may share a network.

    In runs it decides where guards are evaluated: ``integrate(system, x0, t_end, gate=network,
    detector="calibrated")``; a path will do as well.

    Parameters
    ----------
    path : str or path-like
        A file that ``ricochet train`` or a training has written. One that is damaged or does not fit
        together is a ValueError.
    """

    def __init__(self, path):
        path = os.fspath(path)
        with open(path, "rb") as file:
            content = file.read()
        super().__init__(content, os.fsdecode(path))

    @classmethod
    def from_bytes(cls, content, name="bytes"):
        """The network whose file has this content; ``name`` stands for it in messages."""
        network = cls.__new__(cls)
        _ricochet.Network.__init__(network, content, name)
        return network

    def save(self, path):
        """Writes the model file, which is complete, or as it was before."""
        path = os.fspath(path)
        part = path + (b".part" if isinstance(path, bytes) else ".part")
        try:
            with open(part, "wb") as file:
                file.write(self.to_bytes())
            os.replace(part, path)
        except BaseException:
            if os.path.exists(part):
                os.remove(part)
            raise

    def __reduce__(self):
        return Network.from_bytes, (self.to_bytes(),)

    def __eq__(self, other):
        return isinstance(other, Network) and self.to_bytes() == other.to_bytes()

    __hash__ = None

    def __repr__(self):
        widths = "-".join(map(str, [self.inputs] + [bias.size for _, bias in self.layers]))
        return f"<Network: {self.kind} {widths} for {self.system or 'any system'}>"


def set_gate(options):
    """``gate`` as a network, where it is a path."""
    gate = options.get("gate")
    if gate is not None and not isinstance(gate, _ricochet.Network):
        if not isinstance(gate, (str, bytes, os.PathLike)):
            raise TypeError(f"gate: found a {type(gate).__name__}, expected a Network or the path "
                            "of a model")
        options["gate"] = Network(gate)
