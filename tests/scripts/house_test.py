#!/usr/bin/env python3
"""The figures of scripts/house."""
import json
import unittest

from common import ROOT, output, script


class House(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.house = script("house")
        cls.figures = json.loads(output("scripts/house", "--json"))

    def test_the_rooms_add_up_to_the_lines_of_the_files(self):
        lines = {name: len((ROOT / name).read_text(errors="replace").splitlines()) for name in self.house.tracked()}
        total = self.figures["total"]
        of_tests = sum(n for name, n in lines.items() if name.startswith("tests/"))
        self.assertEqual(total["tests"], of_tests)
        self.assertEqual(total["code"] + total["comment"] + total["blank"], sum(lines.values()) - of_tests)
        library = sum(n for name, n in lines.items() if name.startswith(("include/", "src/")))
        self.assertEqual(sum(self.figures["library"].values()), library)
        for key, count in total.items():
            self.assertEqual(count, sum(row[key] for row in self.figures["rooms"].values()), key)

    def test_every_header_is_public_or_detail_or_private(self):
        headers = [p for top in ("include", "src") for ending in ("hpp", "h", "inc") for p in (ROOT / top).rglob(f"*.{ending}")
                   if not self.house.forwards(str(p.relative_to(ROOT)))]
        total = self.figures["total"]
        self.assertEqual(total["public"] + total["detail"] + total["private"], len(headers))

    def test_arrows_against_the_order_are_those_that_are_listed(self):
        against = [a for a in self.figures["arrows"] if not a["permitted"]]
        self.assertEqual(sum(a["includes"] for a in against), len(self.figures["against"]))
        self.assertTrue(self.house.may("scene", "core") and self.house.may("learn_steps", "nonsmooth"))
        self.assertFalse(self.house.may("core", "scene") or self.house.may("learn", "faults"))
        self.assertTrue(self.house.may("room of tomorrow", "core"))

    def test_no_include_runs_against_the_order(self):
        self.assertEqual(self.figures["against"], [])

    def test_what_a_room_stands_on_comes_before_it(self):
        rooms = list(self.house.STANDS_ON)
        for room, others in self.house.STANDS_ON.items():
            for other in others.split():
                self.assertLess(rooms.index(other), rooms.index(room), room)

    def test_no_room_includes_private_headers_of_another(self):
        self.assertTrue(self.house.is_closed("scene", "src/core/engine.hpp", "core"))
        self.assertFalse(self.house.is_closed("core", "src/core/engine.hpp", "core"))
        self.assertFalse(self.house.is_closed("scene", "src/base/require.hpp", "base"))
        self.assertEqual(self.figures["private"], [])

    def test_no_type_of_users_is_in_a_folder_detail(self):
        found = self.house.public_in_detail
        inside = "namespace ricochet {\nnamespace detail {\nstruct A {\n};\n}  // namespace detail\n"
        self.assertEqual(found(inside + "}  // namespace ricochet\n"), [])
        self.assertEqual(found(inside + "class RICOCHET_ALIGNED B {\n};\nstruct C;\nenum class D { e };\n}  // namespace ricochet\n"),
                         ["B", "D"])
        self.assertEqual(self.figures["public_in_detail"], [])

    def test_every_door_is_used(self):
        files = self.house.tracked()
        uses = {(to, name.split("/")[1]) for name in files if name.startswith("src/")
                for _, to in self.house.included(name, (ROOT / name).read_text(errors="replace"), files)}
        for header, rooms in self.house.DOORS.items():
            for room in rooms.split():
                self.assertIn((header, room), uses)

    def test_lines_are_counted_as_what_they_hold(self):
        text = 'int a;  // code\n\n// comment\n/* comment\n\n   */ int b;\nconst char* c = "// code";\n'
        self.assertEqual(self.house.count_lines("a.cpp", text), (3, 2, 2))

    def test_functions_are_found_with_their_lines(self):
        text = """
#define MACRO(x) if (x) { x(); }
namespace a::b {
template <class T = decltype(f())>
struct S : Base<(1 > 0)> {
    explicit(true) S(int x) : x_{x}, y_(x)
    {
    }
    [[nodiscard]] auto operator()(Options o = {}) const noexcept(true) -> decltype(auto) { return 1; }
    int x_ = f({1});
    enum class E { a, b };
};
template <class T>
    requires requires(T t) { t.x; }
void S<T>::run(const char* c) &&
{
    if (c == "}") { f([] { return '{'; }); }
    // }
}
MACRO(1)
int values[] = {1, 2};
int last() { return 1'000; }
extern "C" { void in_c(void) { } }
}
"""
        self.assertEqual([(name, lines) for name, lines, _ in self.house.functions(text)],
                         [("S", 3), ("operator()", 1), ("S<T>::run", 5), ("last", 1), ("in_c", 1)])

    def test_a_reason_stands_directly_above_its_function(self):
        text = """
/// What it does.
// Long: a table.
template <class T>
int table() { return 1; }
// Long: a table.

int apart() { return 1; }
struct S {
public:
    // Long: a list.
    [[nodiscard]] int list() const { return 1; }
    // Longer than others.
    int other() { return 1; }
    // Long:
    int no_reason() { return 1; }
};
"""
        self.assertEqual([(name, reason) for name, _, reason in self.house.functions(text)],
                         [("table", "a table."), ("apart", ""), ("list", "a list."), ("other", ""), ("no_reason", "")])

    def test_long_functions_have_a_reason(self):
        without = [f["where"] for f in self.figures["long_functions"]]
        self.assertEqual(without, [])
        reasons = sum(line.strip().startswith(self.house.REASON) for name in self.house.tracked()
                      if name.startswith(("include/", "src/"))
                      for line in (ROOT / name).read_text(errors="replace").splitlines())
        self.assertEqual(reasons, len(self.figures["long_with_reason"]))


if __name__ == "__main__":
    unittest.main()
