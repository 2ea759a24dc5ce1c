#!/usr/bin/env python3
"""Tests of `export_guard` with modules that stand for PyTorch's: files, and refusals."""

import importlib.util
import json
import math
import struct
import sys
import tempfile
import types
import unittest
from pathlib import Path

SCRIPT = Path(__file__).resolve().parents[2] / "scripts" / "export_pytorch.py"


class Tensor:
    """Rows of numbers, or one row, of float64."""

    dtype = "float64"

    def __init__(self, values):
        self.values = values

    @property
    def shape(self):
        nested = isinstance(self.values[0], list)
        return (len(self.values), len(self.values[0])) if nested else (len(self.values),)

    def numel(self):
        return math.prod(self.shape)

    def flatten(self):
        return Tensor(sum(self.values, []) if isinstance(self.values[0], list) else self.values)

    def tolist(self):
        return self.values


class Module:
    def children(self):
        return []


class Linear(Module):
    def __init__(self, weight, bias):
        self.weight, self.bias = Tensor(weight), Tensor(bias)

    def __call__(self, x):
        rows = zip(self.weight.values, self.bias.values)
        return Tensor([b + sum(w * v for w, v in zip(row, x.values)) for row, b in rows])


class SiLU(Module):
    def __call__(self, x):
        return Tensor([v / (1 + math.exp(-v)) for v in x.values])


class Tanh(Module):
    def __call__(self, x):
        return Tensor([math.tanh(v) for v in x.values])


class Softplus(Module):
    beta, threshold = 2, 20


class Dropout(Module):
    pass


class Sequential(Module):
    def __init__(self, *modules):
        self.modules = modules

    def children(self):
        return self.modules

    def __call__(self, x):
        for module in self.modules:
            x = module(x)
        return x


class Residual(Sequential):
    def __call__(self, x):
        return Tensor([a + b for a, b in zip(x.values, super().__call__(x).values)])


class ModuleList:
    def __init__(self, modules):
        self.modules = modules

    def state_dict(self, prefix):
        return {
            f"{prefix}{k}.{name}": getattr(module, name)
            for k, module in enumerate(self.modules)
            for name in ("weight", "bias")
        }


def load_script():
    torch = types.ModuleType("torch")
    torch.float32, torch.float64 = "float32", "float64"
    torch.nn = types.SimpleNamespace(Linear=Linear, ModuleList=ModuleList)
    torch.tensor = lambda values, dtype: Tensor(values)
    sys.modules["torch"] = torch
    spec = importlib.util.spec_from_file_location("export_pytorch", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


SCRIPT_MODULE = load_script()

FIRST = Linear([[0.5, -1.0], [0.25, 2.0]], [0.1, -0.2])
SECOND = Linear([[1.0, 0.5], [-0.5, 0.75]], [0.0, 0.3])
LAST = Linear([[2.0, -1.5]], [0.05])


class ExportGuard(unittest.TestCase):
    def written(self, network, features, **options):
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "guard.safetensors"
            SCRIPT_MODULE.export_guard(path, network, features, **options)
            data = path.read_bytes()
        (length,) = struct.unpack("<Q", data[:8])
        return json.loads(data[8 : 8 + length]), data[8 + length :]

    def test_a_residual_network_is_written_with_its_output(self):
        network = Sequential(FIRST, SiLU(), Residual(SECOND, SiLU()), LAST)
        header, data = self.written(network, [0.75, -1.5], offset=[0.25, 0.0], scale=[2.0, 1.0])
        about = header["__metadata__"]
        self.assertEqual((about["kind"], about["activation"], about["residual"]), ("guard", "silu", "1"))
        self.assertEqual(about["self_test_output"], repr(network(Tensor([1.0, -1.5])).values[0]))
        self.assertEqual(header["layers.1.weight"]["shape"], [2, 2])
        begin, end = header["layers.1.weight"]["data_offsets"]
        self.assertEqual(struct.unpack("<4d", data[begin:end]), (1.0, 0.5, -0.5, 0.75))

    def test_what_no_guard_has_is_refused(self):
        for network, message in [
            (Sequential(FIRST, SECOND, LAST), "expected an activation before Linear layer 1"),
            (Sequential(FIRST, SiLU(), SECOND, Tanh(), LAST), "found silu and tanh"),
            (Sequential(FIRST, SiLU()), "expected a Linear layer at the end"),
            (Sequential(FIRST, Softplus(), LAST), "Softplus of beta 1"),
            (Sequential(FIRST, Dropout(), LAST), "found Dropout"),
            (Sequential(FIRST, SiLU(), Residual(SECOND), LAST), "one Linear layer and its activation"),
        ]:
            with self.assertRaisesRegex(ValueError, message):
                self.written(network, [0.0, 0.0])


if __name__ == "__main__":
    unittest.main()
