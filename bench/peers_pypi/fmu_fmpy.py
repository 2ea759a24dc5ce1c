"""FMPy: model exchange by its CVODE."""
import os
import sys

import numpy as np

import problems
from cell import events, main, version


def ball(fmi, tolerance):
    def make():
        import fmpy
        folder = fmpy.extract(os.path.join(os.environ["RICOCHET_FMUS"], f"ball{fmi}.fmu"))
        description = fmpy.read_model_description(folder)

        def solve():
            return fmpy.simulate_fmu(folder, model_description=description, validate=False,
                                     fmi_type="ModelExchange", solver="CVode", stop_time=problems.FMU_END,
                                     output_interval=problems.FMU_END, relative_tolerance=tolerance,
                                     record_events=True, output=["height"])

        def read(result):
            t = np.asarray(result["time"])  # both sides of an event are recorded
            return events(t[1:][np.diff(t) == 0])
        return solve, read
    return make


def cells():
    return [("fmu-ball", "FMPy", f"CVODE, FMI {fmi}", tolerance, ball(fmi, tolerance))
            for fmi in (2, 3) for tolerance in (1e-4, 1e-8, 1e-12)]


if __name__ == "__main__":
    sys.exit(main({"FMPy": version("FMPy")}, cells()))
