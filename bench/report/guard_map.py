"""The map of guards: who wins by what is known of a guard, how often it fires and what it costs."""

PRICES = (0, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2)  # [s] that a call costs more than here
WAYS = ("every step", "every k", "planned", "verified", "certified", "calibrated")

LEAD = (
    "A ball in a cavern of 10 000 segments, of whose wall more or less is shown. Which way to "
    "check the guard is fastest with exactly the events of a check at every step, and how many "
    "times as fast as that, then the next one; in brackets what is faster still, but changes "
    "events. Times of runs are measured; what an expensive guard adds is the number of calls times "
    "its price. The proof of the certified network and the training of the gates are not in these "
    "times.")


def cost(way, price):
    """[s] a step where a call costs `price` [s] more."""
    return way["time"] + way["calls"] * price


def group(name):
    return "every k" if name.removeprefix("every ").isdigit() else name


def winner(row, price):
    """The cheapest way that keeps the events, how many times as fast as a check at every step it
    is, and the cheapest way of all with the same number, or none if that is the first."""
    every = cost(row["ways"][0], price)
    keeping = min((way for way in row["ways"] if way["same"]), key=lambda way: cost(way, price))
    any_way = min(row["ways"], key=lambda way: cost(way, price))
    other = None if any_way["same"] else (any_way, every / cost(any_way, price))
    return keeping, every / cost(keeping, price), other


def panels(found):
    """A panel for what is known: tiles of the gain, and a mark for who wins."""
    out = []
    for panel in found["panels"]:
        rows = sorted(panel["rows"], key=lambda row: row["rate"])
        gains, marks = [], {}
        for j, row in enumerate(rows):
            for i, price in enumerate(PRICES):
                way, gain, _ = winner(row, price)
                gains.append(gain)
                marks.setdefault(group(way["name"]), []).append((i, j - 0.3))
        out.append({
            "title": f"known: {panel['known']}", "x": "price of a call [us]",
            "y": "events in 1000 steps", "log_x": False, "log_y": False,
            "tiles": {"x": [1e6 * price for price in PRICES],
                      "y": [float(f"{row['rate']:.2g}") for row in rows], "value": gains},
            "curves": [{"name": name, "points": True, "colour": WAYS.index(name),
                        "x": [i for i, _ in marks[name]], "y": [j for _, j in marks[name]]}
                       for name in WAYS if name in marks]})
    return out


def text(row, price):
    way, gain, other = winner(row, price)
    every = cost(row["ways"][0], price)
    rest = [one for one in row["ways"][1:]
            if one["same"] and group(one["name"]) != group(way["name"])]
    said = way["name"] if way["name"] == "every step" else f"{way['name']} {gain:.3g}x"
    if rest and way["name"] != "every step":
        second = min(rest, key=lambda one: cost(one, price))
        said += f", then {second['name']} {every / cost(second, price):.3g}x"
    return said + (f" ({other[0]['name']} {other[1]:.3g}x)" if other else "")


def table(found):
    header = ["known", "events in 1000 steps"]
    header += ["as it is" if price == 0 else f"+{1e6 * price:g} us" for price in PRICES]
    rows = []
    for panel in found["panels"]:
        for row in sorted(panel["rows"], key=lambda row: row["rate"]):
            rows.append([panel["known"], f"{row['rate']:.2g}"] +
                        [text(row, price) for price in PRICES])
    return header, rows


def ways_table(found):
    """What was measured: time and calls a step of every way."""
    header = ["known", "events in 1000 steps", "way", "time of a step", "calls a step", "events",
              "the same events"]
    rows = []
    for panel in found["panels"]:
        for row in sorted(panel["rows"], key=lambda row: row["rate"]):
            for way in row["ways"]:
                rows.append([panel["known"], f"{row['rate']:.2g}", way["name"],
                             f"{1e9 * way['time']:.3g} ns", f"{way['calls']:.3g}",
                             str(way["events"]), "yes" if way["same"] else "no"])
    return header, rows


def remark(found):
    """What the networks have cost."""
    return (f"The certified network was trained and proved in {found['proof_seconds']:.0f} s, the "
            f"gates in {found['training_seconds']:.0f} s; the whole map took "
            f"{found['seconds']:.0f} s. Again: `{found['command']}`.")
