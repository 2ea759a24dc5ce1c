#!/usr/bin/env python3
"""Writes the likely misspellings of the names that a hybrid system, or an inclusion, may declare.

usage: misspellings.py > include/ricochet/detail/misspellings.inc
       misspellings.py inclusion > include/ricochet/nonsmooth/detail/inclusion_misspellings.inc
"""

import sys

# Functions first, then values; of the latter a data member is meant, too.
FUNCTIONS = """flow guard guards guard_rate guard_rates guard_curvature guard_info reset rest enabled
    next_time_event previous_time_event time_reset mode_name speed_bound acceleration_bound
    lipschitz lower_bound upper_bound set_valued""".split()
VALUES = "guard_count mode_count crossing unilateral changes_dimension forward_only".split()
WHAT = "a system"
if sys.argv[1:] == ["inclusion"]:
    FUNCTIONS = """smooth_jacobian mass observe act offset offset_rate branch_bound static_bound
        bound_gradient""".split()
    VALUES = "confines affine".split()
    WHAT = "an inclusion"
KNOWN = set(FUNCTIONS + VALUES)
# Words of their own, and names of C++.
OTHERS = {"rest", "gard", "resets", "enable", "enables", "crossings", "crossin", "lower", "upper",
          "flows", "cat", "acts"}


def one_slip(name):
    """What one slip of the fingers, another vowel or a plural makes of a name."""
    yield name + "s"
    if name == "unilateral":
        yield "is_unilateral"
    for i in range(len(name)):
        if len(name) > 4:
            yield name[:i] + name[i + 1:]
        yield name[:i + 1] + name[i:]
        if i + 1 < len(name):
            yield name[:i] + name[i + 1] + name[i] + name[i + 2:]
        if len(name) > 4 and name[i] in "aeiou":
            for vowel in "aeiou":
                yield name[:i] + vowel + name[i + 1:]
    if name == "time_reset":
        yield "timed_reset"


def other_cases(name):
    """The name in other habits of writing, but for capitals alone, which may be macros."""
    words = name.split("_")
    pascal = "".join(word.capitalize() for word in words)
    yield from (pascal, pascal[0].lower() + pascal[1:], name.capitalize())
    yield from ("".join(words), "_".join(word.capitalize() for word in words))


def is_usable(name):
    return name not in KNOWN | OTHERS and not name.startswith("_") and "__" not in name \
        and not name.endswith("_")


def rows(kind, names, seen):
    for name in names:
        found = []
        for wrong in list(other_cases(name)) + list(one_slip(name)):
            if is_usable(wrong) and wrong not in seen:
                seen.add(wrong)
                found.append(wrong)
        yield f"// {name}"
        calls = [f"RICOCHET_{kind}({wrong}, {name})" for wrong in found]
        per_row = max(1, 100 // (1 + max(map(len, calls))))
        for i in range(0, len(calls), per_row):
            yield " ".join(calls[i : i + per_row])


def main():
    seen = set()
    print(f"// Likely misspellings of the names that {WHAT} may declare, each with the name that")
    print("// was meant. Written by scripts/misspellings.py. Included once for every use, with the")
    print("// two macros defined.")
    print("\n// clang-format off")
    for row in list(rows("FUNCTION", FUNCTIONS, seen)) + list(rows("VALUE", VALUES, seen)):
        print(row)
    print("// clang-format on")


main()
