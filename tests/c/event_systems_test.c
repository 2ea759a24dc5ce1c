/* Twenty-five small systems whose events are decided at their borders, those that no other test in
 * C has. Of the others a thermostat, a relay, resets that decline and two doses are in
 * meaning_test.c, accumulating tanks and saddles in rest_test.c, ticks in instants_test.c and
 * times_test.c, vetoes in veto_test.c. */
#include "machine.h"

#define TINY 0x1p-53

FLOW(still, d[0] = d[1] = 0)
FLOW(falls, d[0] = -1)
FLOW(rises, d[0] = 1)
FLOW(to_and_fro, d[0] = m ? 1 : -1)
FLOW(from_and_to, d[0] = m ? -1 : 1)
GUARD(until_1, 1 - t)
GUARD(itself, x[0])
GUARD(either_side, m ? -x[0] : x[0])
RESET(next_mode, ++*m)
RESET(toggle, *m = 1 - *m)

GUARD(load, 0.5 - sin(t))
RESET(slips, if (sin(t) >= 0.5) * m = 1)
GUARD(sine, sin(x[0]))
static int resets_of_4 = 0;
RESET(count, ++resets_of_4)
GUARD(two_times, i == 0 ? (t - 1) * (t - 1.05) : 1.08 - t)
RESET(count_each, x[i] += 1)
FLOW(creeps, d[0] = -1e-15)
GUARD(above_1, x[0] - 1)
RESET(leave, )
FLOW(decays, d[0] = -x[0])
GUARD(until_dose, 2.95 - t)
RESET(dose, x[0] += 2)
TICK(add_dose, x[0] += 2)
RESET(halve, x[0] *= 0.5)
RESET(lower, x[0] = fmin(x[0], i == 0 ? 1 : 2))
RESET(cap, x[0] = fmin(x[0] + 2, 10))
RESET(set, x[0] = 5)
RESET(flip, x[0] = 1 - x[0])

FLOW(drops, d[0] = x[1]; d[1] = -2; d[2] = 0)
RESET(equal_floors, x[0] = 0; x[1] *= -0.5; x[2] += 1)
RESET(unequal_floors, x[0] = 0; x[1] *= i == 0 ? -0.5 : -0.8; x[2] += 1)
RESET(reversed_floors, unequal_floors(1 - i, m, t, x))

FLOW(flies, d[0] = x[2]; d[1] = x[3]; d[2] = d[3] = 0)
static const double right[2][2] = {{0.6, 0.8}, {-0.8, 0.6}};
static const double wide[2][2] = {{0.86602540378443865, 0.5}, {-0.86602540378443865, 0.5}};
static void mirror(const double* n, double* x)
{
    const double speed = n[0] * x[2] + n[1] * x[3];
    x[2] -= 2 * speed * n[0];
    x[3] -= 2 * speed * n[1];
}
GUARD(right_walls, right[i][0] * x[0] + right[i][1] * x[1])
RESET(right_mirror, mirror(right[i], x))
GUARD(wide_walls, wide[i][0] * x[0] + wide[i][1] * x[1])
RESET(wide_mirror, mirror(wide[i], x))

FLOW(both_rise, d[0] = d[1] = 1)
GUARD(clock_i, 1 - x[i])
RESET(set_bit, *m |= 1u << i)
RESET(own_mode, *m = 1 + (rc_mode)i)
static int bit_is_0(size_t i, rc_mode m)
{
    return (m >> i & 1) == 0;
}
static int in_mode_0(size_t i, rc_mode m)
{
    (void)i;
    return m == 0;
}
static int in_mode_1(size_t i, rc_mode m)
{
    (void)i;
    return m == 1;
}
static int below_mode_3(size_t i, rc_mode m)
{
    (void)i;
    return m < 3;
}

GUARD(two_sides, i == 0 ? x[0] : -x[0])
RESET(other_side, *m = i == 0)
FLOW(by_sign, d[0] = -x[1]; d[1] = 0)
GUARD(signed_side, x[1] * x[0])
RESET(change_sign, x[1] = -x[1])

GUARD(either_side_of, m == 0 ? x[0] : -x[0])
FLOW(there_and_back, d[0] = m == 1 ? 1 : -1)
FLOW(when_told, d[0] = m ? -1 : 0)
RESET(stop, *m = 0)
TICK(start, *m = 1)
GUARD(room, m ? 1 - x[0] : x[0])
GUARD(stages, x[0] - (m == 0 ? 1 : m == 1 ? 0.5 : 0))

FLOW(is_thrown, d[0] = x[2]; d[1] = x[3]; d[2] = 0; d[3] = -10)
GUARD(floor_and_mark, i == 0 ? x[1] : x[0] - 10)
RESET(bounce, x[1] = 0; x[3] *= -0.5)
REST(slide, x[1] = x[3] = 0)
FLOW(ball, d[0] = x[1]; d[1] = -10)
RESET(rebound, x[0] = 0; x[1] *= -0.5)
REST(launch, x[0] = 0; x[1] = 5)
REST(lie, x[0] = x[1] = 0)
TICK(kick, x[1] += 1)
FLOW(lifted, d[0] = x[1]; d[1] = t < 1 ? -10 : -10 + 10 * (t - 1))

static void six_clocks(rc_mode m, double t, const double* x, double* d)
{
    size_t i;
    UNUSED;
    for (i = 0; i < 6; ++i) d[i] = 1;
}
GUARD(eighth, 0.125 - x[i])
RESET(set_back, x[i] = 0)
GUARD(square, (x[0] - 1) * (x[0] - 1))
TICK(nothing, )

FLOW(cart, d[0] = x[1]; d[1] = 0; d[2] = 1)
GUARD(cart_and_clock, i == 0 ? x[0] : 1 - x[2])
RESET(push, x[1] = i == 0 ? 0 : -1; x[2] = i == 0 ? x[2] : 0)
FLOW(glides, d[0] = x[1]; d[1] = 0)
TICK(pull, x[1] = -1)
RESET(hold, x[1] = 0)

/* clang-format off */
static const struct machine machines[] = {
    {"2", 2, 1, 2, still, load, slips, {0}, 1,
     .expected = {.events = 1, .times = {0.523598775598299}, .mode = 1}},
    {"4", 1, 1, 0, rises, sine, count, {0.5}, 100, .expected = {.events = 16, .x = {100.5}}},
    {"5 window", 2, 2, 0, still, two_times, count_each, {0}, 2,
     .expected = {.events = 2, .times = {1.08, 1.08}, .x = {1, 1}}, .window = 0.1},
    {"5 creeping", 1, 1, 0, creeps, above_1, leave, {1 + 8 * TINY}, 4,
     .expected = {.events = 1, .x = {1}}},
    {"6 tick", 1, 1, 0, decays, until_dose, dose, {1}, 10,
     .expected = {.events = 2, .times = {2.95, 2.95}, .x = {0.003515035758990}},
     .tick = 2.95, .at_tick = add_dose},
    {"7 halves", 2, 2, 0, still, until_1, halve, {8}, 2, .expected = {.x = {2}}},
    {"7 min", 2, 2, 0, still, until_1, lower, {3}, 2, .expected = {.x = {1}}},
    {"7 cap", 2, 2, 0, still, until_1, cap, {7}, 2, .expected = {.x = {10}}},
    {"7 set", 2, 2, 0, still, until_1, set, {1}, 2, .expected = {.x = {5}}},
    {"7 flip", 2, 2, 0, still, until_1, flip, {0}, 2, .expected = {.x = {0}}},
    {"8 equal", 3, 2, 0, drops, itself, equal_floors, {1}, 1.5,
     .expected = {.events = 2, .times = {1, 1}, .x = {0.25, 0, 2}}},
    {"8 unequal", 3, 2, 0, drops, itself, unequal_floors, {1}, 2,
     .expected = {RC_CONFLICTING_RESETS}},
    {"8 reversed", 3, 2, 0, drops, itself, reversed_floors, {1}, 2,
     .expected = {RC_CONFLICTING_RESETS}},
    {"9 right", 4, 2, 0, flies, right_walls, right_mirror, {0, 1, 0, -1}, 2,
     .expected = {.x = {0, 1, 0, 1}}},
    {"9 wide", 4, 2, 0, flies, wide_walls, wide_mirror, {0, 1, 0, -1}, 2,
     .expected = {RC_CONFLICTING_RESETS}},
    {"10", 2, 2, 4, both_rise, clock_i, set_bit, {0}, 2,
     .expected = {.events = 2, .times = {1, 1}, .mode = 3, .x = {2, 2}}, .enabled = bit_is_0},
    {"10 conflict", 2, 2, 4, both_rise, clock_i, own_mode, {0}, 2,
     .expected = {RC_CONFLICTING_RESETS}, .enabled = in_mode_0},
    {"11 two guards", 1, 2, 2, to_and_fro, two_sides, other_side, {1}, 3,
     .expected = {RC_ENDLESS_CASCADE}},
    {"11 rising", 1, 1, 2, from_and_to, either_side, toggle, {-1}, 3,
     .expected = {RC_ENDLESS_CASCADE}, .crossing = RC_RISING},
    {"11 sign", 2, 1, 0, by_sign, signed_side, change_sign, {1, 1}, 3,
     .expected = {RC_ENDLESS_CASCADE}},
    {"12", 1, 1, 8, falls, above_1, next_mode, {3}, 5,
     .expected = {.events = 1, .times = {2}, .mode = 1, .x = {-2}}},
    {"13", 1, 1, 3, there_and_back, either_side_of, next_mode, {1}, 3,
     .expected = {.events = 2, .times = {1, 1}, .mode = 2, .x = {-2}}},
    {"14", 1, 1, 2, when_told, itself, stop, {0}, 3,
     .expected = {.events = 2, .times = {1, 1}}, .tick = 1, .at_tick = start},
    {"14 enabled", 1, 1, 2, when_told, itself, stop, {0}, 3,
     .expected = {.events = 2, .times = {1, 1}},
     .enabled = in_mode_1, .tick = 1, .at_tick = start},
    {"15 triangle", 1, 1, 2, to_and_fro, room, toggle, {0.5}, 4,
     .expected = {.events = 4, .times = {0.5, 1.5, 2.5, 3.5}, .x = {0.5}}},
    {"15 stages", 1, 1, 4, falls, stages, next_mode, {2}, 3,
     .expected = {.events = 3, .times = {1, 1.5, 2}, .mode = 3, .x = {-1}},
     .enabled = below_mode_3},
    {"16", 4, 1, 0, is_thrown, floor_and_mark, bounce, {0, 0.1, 1, 0}, 4,
     .expected = {.times = {0.424264068711929}, .accumulates = 1, .x = {4, 0, 1, 0}},
     .rest = slide},
    {"16 recorder", 4, 2, 0, is_thrown, floor_and_mark, bounce, {0, 0.1, 1, 0}, 4,
     .expected = {.times = {0.424264068711929}, .accumulates = 1, .x = {4, 0, 1, 0}},
     .rest = slide},
    {"17", 2, 1, 0, ball, itself, rebound, {0.2, 0}, 10,
     .expected = {.times = {0.6, 2.6, 4.6, 6.6, 8.6}, .accumulates = 1, .x = {0.2, -1.5}},
     .rest = launch},
    {"18 kick", 2, 1, 0, ball, itself, rebound, {0.2, 0}, 2.1,
     .expected = {.times = {0.6}, .accumulates = 1, .x = {0.05, 0}},
     .rest = lie, .tick = 2, .at_tick = kick},
    {"18 lift", 2, 1, 0, lifted, itself, rebound, {0.2, 0}, 3,
     .expected = {.times = {0.6}, .accumulates = 1, .x = {5.0 / 3, 5}},
     .rest = lie, .tick = 1, .at_tick = nothing},
    {"20", 6, 6, 0, six_clocks, eighth, set_back, {0, -11 * TINY, -17 * TINY, -20 * TINY, -21 * TINY, -22 * TINY}, 5.06,
     .expected = {.events = 240, .x = {0.06, 0.06, 0.06, 0.06}}},
    {"22 touch", 1, 1, 2, rises, square, toggle, {0}, 2,
     .expected = {.events = 2, .times = {1, 1}, .x = {2}}, .tick = 1, .at_tick = nothing},
    /* A cart that stands at 0 and is set in motion outward, by a tick or by another guard. */
    {"standing, tick", 2, 1, 0, glides, itself, hold, {0}, 2,
     .expected = {.events = 2, .times = {1, 1}}, .tick = 1, .at_tick = pull},
    {"standing, guard", 3, 2, 0, cart, cart_and_clock, push, {0}, 2.5,
     .expected = {.events = 4, .times = {1, 1, 2, 2}, .x = {0, 0, 0.5}}},
    {"standing, tick, either", 2, 1, 0, glides, itself, hold, {0}, 2,
     .expected = {.events = 2, .times = {1, 1}}, .tick = 1, .at_tick = pull, .crossing = RC_EITHER},
    {"standing, tick, recorded", 2, 1, 0, glides, itself, hold, {0}, 2,
     .expected = {.events = 2, .times = {1, 1}, .x = {-1, -1}},
     .tick = 1, .at_tick = pull, .recorded = 1},
    {"standing, guard, recorded", 3, 2, 0, cart, cart_and_clock, push, {0}, 1.5,
     .expected = {.events = 2, .times = {1, 1}, .x = {-0.5, -1, 0.5}}, .recorded = 1},
};
/* clang-format on */

/* Times are met to the errors of location, states to those of the tolerance. */
static void expect(const struct machine* machine, rc_simulation* simulation)
{
    const struct expected* expected = &machine->expected;
    size_t k, met = 0;
    CHECK(rc_outcome(simulation) == expected->outcome);
    if (expected->outcome != RC_REACHED_END) return;
    CHECK(expected->events == 0 || rc_event_count(simulation) == expected->events);
    for (k = 0; k < rc_event_count(simulation); ++k) {
        const rc_event event = event_at(simulation, k);
        if (expected->accumulates && event.kind != RC_ACCUMULATION) continue;
        if (met < most_times && expected->times[met] > 0) {
            CHECK(fabs(event.t - expected->times[met]) < 1e-8);
        }
        ++met;
    }
    for (k = 0; k < most_times && expected->times[k] > 0; ++k) continue;
    CHECK(!expected->accumulates || met == k);
    CHECK(rc_mode_now(simulation) == expected->mode);
    for (k = 0; k < machine->n && k < 4; ++k) {
        CHECK(fabs(rc_state(simulation)[k] - expected->x[k]) < 1e-7);
    }
}

int main(void)
{
    static const int32_t methods[] = {RC_DOPRI5, RC_FEHLBERG78};
    size_t i, k;
    for (i = 0; i < sizeof machines / sizeof *machines; ++i) {
        for (k = 0; k < 2; ++k) {
            const rc_options options = options_of(&machines[i], methods[k]);
            rc_simulation* const simulation =
                simulation_of(&machines[i], machines[i].start, &options);
            CHECK_STATUS(RC_OK, rc_run(simulation));
            fprintf(stderr, "system %s, method %d\n", machines[i].name, (int)methods[k]);
            expect(&machines[i], simulation);
            rc_simulation_free(simulation);
        }
    }
    CHECK(resets_of_4 == 2 * 16); /* by two methods */
    return 0;
}
