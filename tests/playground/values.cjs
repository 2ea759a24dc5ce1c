// Runs the module of the playground as values.cpp runs its systems natively: the same lines in and out.
//
//     node values.cjs build/playground [runs] < systems.txt
//     node values.cjs build/playground --programs FOLDER     writes the programs that the page shows, with its first values
"use strict";
const fs = require("fs");
const path = require("path");

const folder = path.resolve(process.argv[2]);
const systems = require(path.join(folder, "systems.js"));

function printRun(library, line) {
  const [system, ...parameters] = line.trim().split(/\s+/).map(Number);
  library.HEAPF64.set(parameters, library._play_parameters() / 8);
  const events = library._play_run(system, 0);
  const rows = [`${events} ${library.UTF8ToString(library._play_message())}`];
  const first = library._play_events() / 8;
  for (let k = 0; k < events; ++k) rows.push([...library.HEAPF64.subarray(first + 6 * k, first + 6 * (k + 1))].join(" "));
  console.log(rows.join("\n"));
}

function timeRuns(library, runs) {
  library.HEAPF64.set([9.81, 0.9, 10, 0, 20.5], library._play_parameters() / 8);
  library._play_time_of_runs(0, 1000); // until the engine has optimised it
  const start = process.hrtime.bigint();
  const events = library._play_time_of_runs(0, runs);
  const microseconds = Number(process.hrtime.bigint() - start) / 1000;
  console.error(`${(microseconds / runs).toFixed(2)} us for ${events / runs} impacts`);
}

// The path of the last run ends where the programs of the page do.
function writePrograms(library, into) {
  systems.forEach((of, number) => {
    const values = of.sliders.map((slider) => slider.value);
    library.HEAPF64.set(values, library._play_parameters() / 8);
    library._play_run(number, 2);
    const end = library.HEAPF64[library._play_path() / 8 + 3];
    fs.writeFileSync(path.join(into, `${of.key}.cpp`), of.cpp(values, end));
    fs.writeFileSync(path.join(into, `${of.key}.py`), of.python(values, end));
    fs.writeFileSync(path.join(into, `${of.key}.txt`), `${number} ${values.join(" ")}\n`);
  });
}

require(path.join(folder, "ricochet.js"))({ wasmBinary: fs.readFileSync(path.join(folder, "ricochet.wasm")) }).then((library) => {
  if (process.argv[3] === "--programs") {
    writePrograms(library, process.argv[4]);
    return;
  }
  for (const line of fs.readFileSync(0, "utf8").split("\n")) if (line) printRun(library, line);
  if (process.argv[3]) timeRuns(library, Number(process.argv[3]));
});
