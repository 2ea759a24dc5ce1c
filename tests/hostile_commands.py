#!/usr/bin/env python3
"""Random command lines that nobody hopes for.

    hostile_commands.py <ricochet> [count] [seed]

Every command, with options that are missing, doubled, empty, enormous or of other kinds, and with
directories, devices, pipes and links for files. Each must end with status 0, 1 or 2 (or, where it
takes longer than ten seconds, with 130 after an interrupt, having said that it goes on); bad input
with one sentence and nothing printed or written; nothing that was there before may change but by an
output that names it. Prints what is mishandled, and exits with 1 then.
"""
import hashlib
import json
import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import tempfile

LIMIT = 10  # [s]
NUMBERS = ("0 -0 1 -1 0.5 2 10 1e-3 1e-300 5e-324 1e308 -1e308 1e999 nan -nan inf -inf 0x10 1e 1,5 +1 "
           "++1 99999999999999999999 1e15 1e-15 100 0.01 1e6 1e9 true").split() + ["", " ", "½"]
FILES = ["", " ", "-", "--", "--json", "x" * 300, "y" * 5000, "ü", "\n", "$(id)", "..", ".", "/", "dir",
         "/dev/null", "/dev/full", "/dev/zero", "no/such", "pipe", "link", "dangling", "readonly",
         "in.safetensors", "./dir/../in.safetensors", "in.npy", "a.csv", "a.svg", "b.png", "%s%n", "{}"]
MODELS = ["in.safetensors", "bouncing-ball", "pendulum-gate", "thermostat-gate", "eigenvalue-certified"]
OPTIONS = {
    "simulate": {"--set": "set", "--t-start": NUMBERS, "--t-end": NUMBERS, "--step": NUMBERS,
                 "--rtol": NUMBERS, "--atol": NUMBERS, "--event-tolerance": NUMBERS,
                 "--max-steps": NUMBERS + ["1000"], "--samples": NUMBERS + ["20"],
                 "--mode": ["on", "off", "slip", "x"], "--model": MODELS + FILES,
                 "--detector": ["ends", "extremum", "bernstein", "network", "line", "verified"],
                 "--gate": ["verified", "certified", "calibrated"],
                 "--locator": ["newton", "bisection", "toms748"],
                 "--stepper": ["rk4", "dopri5", "fehlberg78", "cash-karp54", "euler"],
                 "--integrator": ["handover", "event", "bathe", "time-stepping", "explicit"],
                 "--controller": ["constant", "error", "heuristic", "pi", "filter", "learned"],
                 "--json": None, "--csv": FILES, "--plot": FILES, "--kernel": FILES},
    "ensemble": {"--table": ["t.csv"] + FILES, "--count": NUMBERS + ["3"], "--out": FILES,
                 "--vary": ["height=1:2", "x=1:2", "angle=0:1", "height=2:1", "=:", "a=b:c"],
                 "--seed": NUMBERS, "--share": ["1/2", "0/1", "2/1", "x"], "--merge": FILES,
                 "--threads": NUMBERS, "--set": "set", "--t-end": NUMBERS, "--rtol": NUMBERS,
                 "--max-steps": ["1000"], "--json": None},
    "compare": {"--set": "set", "--json": None, "--csv": FILES, "--system": ["fault", "x"]},
    "train": {"--out": FILES, "--kind": ["any-step", "gate"], "--set": "set", "--step": NUMBERS,
              "--seed": NUMBERS, "--checkpoint": FILES, "--resume": None, "--allow-misses": None,
              "--json": None, "--seconds": NUMBERS, "--threads": NUMBERS, "--alpha": NUMBERS,
              "--trainer": ["tqc", "td3", "evolution"]},
    "inspect": {"--json": None},
    "certify": {"--margin": NUMBERS, "--levels": NUMBERS, "--ratio": NUMBERS, "--out": FILES,
                "--keep-threshold": None, "--limit": NUMBERS, "--time-limit": ["0.1", "-1", "0"],
                "--smallest": NUMBERS, "--max-unproved": NUMBERS, "--checkpoint": FILES,
                "--resume": None, "--json": None},
    "systems": {"--json": None},
}
WEIGHTS = [65, 10, 6, 10, 5, 8, 1]
OUTPUTS = ("--csv", "--plot", "--out", "--checkpoint")


class Generator:
    def __init__(self, seed, parameters):
        self.random = random.Random(seed)
        self.parameters = parameters

    def value(self, kind, system):
        if kind != "set":
            return self.random.choice(kind if self.random.random() < 0.95 else FILES + NUMBERS)
        name = self.random.choice(self.parameters.get(system) or ["x"])
        text = name + "=" + self.random.choice(NUMBERS)
        return text if self.random.random() < 0.95 else self.random.choice(FILES)

    def words(self):
        pick = self.random
        command = pick.choices(list(OPTIONS), WEIGHTS)[0]
        system = pick.choice(list(self.parameters) + ["nope"])
        words = {"simulate": [system], "ensemble": [system], "compare": [system],
                 "systems": []}.get(command)
        if command == "train":
            system = pick.choice(["bouncing-ball", "pendulum", "thermostat", "step-policy", "nope"])
            words = [system, "--iterations", "2", "--states", "1000", "--fresh", "100"]
            if system == "step-policy":
                words = [system, "sliding-mode", "--iterations", "2"]
            if pick.random() < 0.8:
                words += ["--out", pick.choice(["m.safetensors", "in.safetensors"] + FILES)]
        elif words is None:
            words = [pick.choice(MODELS + FILES)]
        if pick.random() < 0.03:
            words = words[1:]
        for _ in range(pick.choice([0, 1, 1, 2, 2, 3, 4, 6])):
            name, kind = pick.choice(list(OPTIONS[command].items()))
            if kind is None or pick.random() < 0.02:
                words.append(name)
            elif pick.random() < 0.2:
                words.append(name + "=" + self.value(kind, system))
            else:
                words += [name, self.value(kind, system)]
        if pick.random() < 0.02:
            command = pick.choice(["", "simulat", "--help", "--version"])
        return [command] + words


def fresh(root, models, kernel):
    work = os.path.join(root, "work")
    shutil.rmtree(work, ignore_errors=True)
    os.makedirs(os.path.join(work, "dir"))
    shutil.copy(os.path.join(models, "bouncing-ball.safetensors"), work + "/in.safetensors")
    shutil.copy(kernel, work + "/in.npy")
    for name in ("readonly", "m.safetensors.checkpoint"):
        with open(os.path.join(work, name), "w", encoding="utf-8") as file:
            file.write("keep")
    with open(work + "/t.csv", "w", encoding="utf-8") as file:
        file.write("height\n1\n2\n")
    os.symlink("in.safetensors", work + "/link")
    os.symlink("nowhere", work + "/dangling")
    os.mkfifo(work + "/pipe")
    return work


def content(directory):
    out = {}
    for root, _, names in os.walk(directory):
        for name in names:
            path = os.path.join(root, name)
            if os.path.isfile(path):
                with open(path, "rb") as file:
                    out[os.path.relpath(path, directory)] = hashlib.md5(file.read()).hexdigest()
    return out


def limit_memory():
    resource.setrlimit(resource.RLIMIT_AS, (6 << 30, 6 << 30))


def run(program, words, work):
    """Status, what was printed on both streams, and whether it had to be interrupted."""
    child = subprocess.Popen([program] + words, cwd=work, stdin=subprocess.DEVNULL,
                             stdout=subprocess.PIPE, stderr=subprocess.PIPE, preexec_fn=limit_memory)
    try:
        return (*child.communicate(timeout=LIMIT), child.returncode, False)
    except subprocess.TimeoutExpired:
        child.send_signal(signal.SIGINT)
    try:
        return (*child.communicate(timeout=4 * LIMIT), child.returncode, True)
    except subprocess.TimeoutExpired:
        child.kill()
        return (*child.communicate(), "no answer to an interrupt", True)


def complaints(words, out, err, status, interrupted, before, after):
    found = []
    if status not in ((0, 1, 2, 130) if interrupted else (0, 1, 2)):
        found.append(f"status {status}")
    if interrupted and err.startswith(b"\nricochet: ending"):
        found.append("long, and silent")
    changed = {name for name in before if after.get(name) != before[name]}
    added = set(after) - set(before)
    if status == 2:
        if out or changed or added:
            found.append(f"bad input, but printed or wrote {changed | added}")
        if err.count(b"\n") != 1 or not err.startswith(b"ricochet: ") or len(err) > 3000:
            found.append(f"bad input, but not one sentence: {err[:200]}")
    named = [word.split("=", 1)[1] for word in words if word.startswith(OUTPUTS) and "=" in word]
    named += [after for word, after in zip(words, words[1:]) if word in OUTPUTS]
    targets = {"in.safetensors" if name in ("link", "./dir/../in.safetensors") else name
               for name in named}
    if words[0] == "certify":  # into the model itself, by default
        targets.add("in.safetensors")
    if changed - targets - {"link"} or "m.safetensors.checkpoint" in changed:
        found.append(f"changed {changed}")
    if any(name.startswith("--") and name not in targets for name in added):
        found.append(f"odd files {added}")
    if any(text in err for text in (b"std::", b"basic_string", b"json.exception", b"vector")):
        found.append(f"not a sentence: {err[-200:]}")
    return found


def main():
    program = os.path.abspath(sys.argv[1])
    count = int(sys.argv[2]) if len(sys.argv) > 2 else 1000
    seed = int(sys.argv[3]) if len(sys.argv) > 3 else 1
    models = os.path.join(os.path.dirname(os.path.dirname(program)), "share/ricochet/models")
    kernel = os.path.join(os.path.dirname(os.path.abspath(__file__)),
                          "fixtures/fault_kernels/fault-kernel-1x1-3km.npy")
    systems = json.loads(subprocess.run([program, "systems", "--json"], capture_output=True,
                                        check=True).stdout)
    parameters = {s["name"]: [p["name"] for p in s["parameters"]] for s in systems}
    generator = Generator(seed, parameters)
    bad = 0
    with tempfile.TemporaryDirectory(prefix="ricochet-hostile-") as root:
        work = fresh(root, models, kernel)
        before = content(work)
        for i in range(count):
            words = generator.words()
            out, err, status, interrupted = run(program, words, work)
            after = content(work)
            found = complaints(words, out, err, status, interrupted, before, after)
            if found:
                bad += 1
                shown = " ".join(word if len(word) < 60 else word[:20] + "..." for word in words)
                print(f"{i}: {shown!r}: {'; '.join(found)}; {err[-200:]}", flush=True)
            if after != before:
                work = fresh(root, models, kernel)
                before = content(work)
    print(f"{count} command lines, {bad} mishandled")
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
