"""Networks as guards."""

import os

import numpy as np

from . import _ricochet
from ._compiled import C_GUARD, C_RATE, Compiled


class GuardNetwork(Compiled):
    """A network with one output as a guard: a learned surface, a distance, a neural event function.

    ::

        x_0 = (inputs - offset) scale,  x_k+1 = activation(W_k x_k + b_k) [+ x_k],  g = W_n x_n + b_n

    In ``events``, and as the value of a `Guard`, it is called without Python, with its exact rate
    along the flow. Its attributes ``direction``, ``reset``, ``terminal`` and others are those of
    any function in ``events``.

    Parameters
    ----------
    path : str or path-like
        A model file of the kind "guard" with up to 16 layers of up to 512 values, as
        ``scripts/export_pytorch.py`` writes it. A damaged or inconsistent file raises a ValueError.
    components : sequence of int
        The components of the state that are its inputs; by default the first ones. For a state
        that lacks one the guard is NaN.
    """

    def __init__(self, path, components=()):
        path = os.fspath(path)
        with open(path, "rb") as file:
            content = file.read()
        self._take(_ricochet.GuardNetwork.from_file(content, os.fsdecode(path),
                                                    _numbers(components)))

    @classmethod
    def from_bytes(cls, content, components=(), name="bytes"):
        """The network in the contents of a file; ``name`` stands for the file in messages."""
        return cls._of(_ricochet.GuardNetwork.from_file(content, name, _numbers(components)))

    @classmethod
    def from_layers(cls, layers, activation="tanh", *, offset=(), scale=(), residual=(),
                    components=()):
        """A network from its numbers.

        Parameters
        ----------
        layers : sequence of (weight, bias)
            Arrays of shapes (outputs, inputs) and (outputs,).
        activation : str
            "tanh", "relu", "softplus", "silu" or "sin", after each layer but the last.
        offset, scale : sequences of float, one for each input
            What is subtracted from the inputs, and what they are multiplied with then; by default 0
            and 1.
        residual : sequence of int
            Layers whose input is added to their output.
        """
        return cls._of(_ricochet.GuardNetwork.from_layers(
            [(weight, bias) for weight, bias in layers], activation, list(map(float, offset)),
            list(map(float, scale)), _numbers(residual), _numbers(components)))

    @classmethod
    def _of(cls, network):
        out = cls.__new__(cls)
        out._take(network)
        return out

    def _take(self, network):
        super().__init__(network.value_address, network.address)
        self._network = network
        self._signature = C_GUARD
        rate = Compiled(network.rate_address, network.address)
        rate._kept = (network,)
        rate._signature = C_RATE
        self.rate = rate

    @property
    def inputs(self):
        """Number of its inputs."""
        return self._network.inputs

    @property
    def components(self):
        """The components of the state that are its inputs."""
        return tuple(self._network.components)

    def __call__(self, *at):
        """The guard at (t, x), or at (mode, t, x): a float."""
        x = np.asarray(at[-1], dtype=float)
        return float(self.value(x[list(self._network.components)]))

    def value(self, x):
        """The value for inputs of shape (inputs,), or for rows of them of shape (rows, inputs)."""
        return self._network.value(x)[()]

    def gradient(self, x):
        """The derivatives by the inputs, in the shape of ``x``. A kink has those of the side of 0."""
        return self._network.gradient(x, False)

    def normal(self, x):
        """The gradient divided by its length: the normal of the surface, on the side on which the
        guard is positive, in the shape of ``x``. Zeros where the gradient is 0."""
        return self._network.gradient(x, True)

    def to_bytes(self):
        """The bytes of its file."""
        return self._network.to_bytes()

    def save(self, path):
        """Writes a model file. On failure, an existing file is unchanged."""
        write_whole(path, self.to_bytes())

    def __reduce__(self):
        of = {name: value for name, value in self.__dict__.items()
              if not name.startswith("_") and name != "rate"}
        return _restored, (type(self), self.to_bytes(), self.components, of)

    def __repr__(self):
        return f"GuardNetwork(inputs={self.inputs}, components={self.components})"


def _restored(cls, content, components, attributes):
    out = cls.from_bytes(content, components)
    out.__dict__.update(attributes)
    return out


def _numbers(given):
    out = list(given)
    for number in out:
        if not isinstance(number, (int, np.integer)) or isinstance(number, bool) or number < 0:
            raise ValueError(f"GuardNetwork: found {number!r} among {out!r}, expected whole numbers "
                             "from 0 on")
    return [int(number) for number in out]


def write_whole(path, content):
    """Writes a file; on failure, an existing one is unchanged."""
    path = os.fspath(path)
    part = path + (b".part" if isinstance(path, bytes) else ".part")
    try:
        with open(part, "wb") as file:
            file.write(content)
        os.replace(part, path)
    except BaseException:
        if os.path.exists(part):
            os.remove(part)
        raise
