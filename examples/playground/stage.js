// One drawing for each system: where it is at one time of its path.
"use strict";

const disc = (draw, x, y, radius) => {
  draw.beginPath();
  draw.arc(x, y, radius, 0, 7);
  draw.fill();
};
const line = (draw, ...places) => {
  draw.beginPath();
  for (const [x, y] of places) draw.lineTo(x, y);
  draw.stroke();
};

// The largest number of a column of the path.
const largest = (path, column) => {
  let most = 0;
  for (let i = column; i < path.length; i += 3) most = Math.max(most, Math.abs(path[i]));
  return most || 1;
};

// A column that is filled from `zero` to `level`, both in [0, 1], with a word below.
const gauge = ({ draw, height }, x, zero, level, text, style) => {
  const y = (part) => height - 28 - (height - 40) * part;
  draw.strokeRect(x - 15, y(1), 30, y(0) - y(1));
  draw.fillStyle = style;
  draw.fillRect(x - 15, Math.min(y(zero), y(level)), 30, Math.abs(y(zero) - y(level)));
  draw.textAlign = "center";
  draw.fillText(text, x, height - 8);
};

const prepare = ({ draw }, colours) => {
  draw.strokeStyle = colours.faint;
  draw.fillStyle = colours.line;
};

const stages = {
  ball(canvas, { first, path, colours }) {
    const { draw, width, height } = canvas;
    prepare(canvas, colours);
    const floor = height - 12;
    line(draw, [width / 2 - 90, floor], [width / 2 + 90, floor]);
    disc(draw, width / 2, floor - 9 - ((floor - 24) * first) / largest(path, 1), 9);
  },
  belt(canvas, { t, first, values, path, colours }) {
    const { draw, width, height } = canvas;
    prepare(canvas, colours);
    const scale = (width / 2 - 40) / Math.max(largest(path, 1), 0.1);
    const floor = height - 30;
    const x = width / 2 + scale * first;
    line(draw, [0, floor], [width, floor]);
    const shift = (t * values[0] * scale) % 24;
    for (let mark = shift; mark < width; mark += 24) line(draw, [mark, floor], [mark - 8, floor + 10]);
    const turns = 14;
    const spring = Array.from({ length: turns + 1 }, (_, k) => [((x - 14) * k) / turns, floor - 14 + (k % turns === 0 ? 0 : k % 2 ? 6 : -6)]);
    line(draw, ...spring);
    draw.fillRect(x - 14, floor - 28, 28, 28);
  },
  pendulum(canvas, { first, colours }) {
    const { draw, width, height } = canvas;
    prepare(canvas, colours);
    const middle = [width / 2, height / 2];
    const length = height / 2 - 14;
    const bob = [middle[0] + length * Math.sin(first) + 8, middle[1] + length * Math.cos(first)];
    line(draw, [middle[0], middle[1]], [middle[0], height]);
    line(draw, [middle[0] + 8, middle[1]], bob);
    disc(draw, ...bob, 8);
  },
  thermostat(canvas, { first, values, colours }) {
    prepare(canvas, colours);
    const [, ambient, heated] = values;
    const level = Math.min(Math.max((first - ambient) / (heated - ambient), 0), 1);
    gauge(canvas, canvas.width / 2, 0, level, `${first.toFixed(1)} °`, colours.line);
  },
  diode(canvas, { first, second, path, colours }) {
    prepare(canvas, colours);
    const most = Math.max(largest(path, 1), largest(path, 2));
    [[first, "V1", colours.line], [second, "V2", colours.other]].forEach(([volts, name, style], k) => {
      gauge(canvas, canvas.width * (0.35 + 0.3 * k), 0.5, 0.5 + volts / most / 2, `${name} ${volts.toFixed(2)} V`, style);
    });
  },
  discs(canvas, { first, second, values, colours }) {
    const { draw, width, height } = canvas;
    prepare(canvas, colours);
    const scale = (width - 40) / (values[1] + 2);
    const floor = height - 20;
    line(draw, [10, 0], [10, floor], [width, floor]);
    disc(draw, 10 + scale * first, floor - 0.05 * scale, 0.05 * scale);
    draw.fillStyle = colours.other;
    disc(draw, 10 + scale * second, floor - 0.05 * scale, 0.05 * scale);
  },
};
