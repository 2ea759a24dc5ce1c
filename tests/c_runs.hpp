// Runs of systems with set_valued() through the interface for C, by callbacks that call the
// functions of the system.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <type_traits>
#include <vector>

#include "ricochet/nonsmooth/hand_over.hpp"
#include "ricochet/ricochet.h"
#include "ricochet/simulation.hpp"

namespace ricochet {

/// A system as C describes it. Must outlive its simulations.
template <class System, class X>
class SystemInC {
    using C = detail::CoreState<X>;
    using Set = detail::InclusionOf<System>;
    using W = StateOf<Set>;
    using R = ReactionOf<Set>;
    static constexpr int n = state_size<Set>, m = reaction_size<Set>;

public:
    /// Whether C has inclusions of this size and kind. In C an inclusion says in which modes it
    /// acts; a system whose guards say it tells so by `disabled_guards_end_it`.
    static constexpr bool fits = !requires { System::disabled_guards_end_it; }
    &&n >= 1 && n <= 8 && m >= 1 && m <= 4 &&
        BoxSet<SetOf<Set>>&& detail::confines<Set>() == Confines::reaction;

    SystemInC(const System& system, const X& x0)
        : system_(system), parts_(system, x0, {}, {}, {}), of_(parts_.setup())
    {
        describe_guards();
        describe_inclusion();
        const auto& t = *of_.system;
        callbacks_.size = sizeof callbacks_;
        callbacks_.dimension = static_cast<std::size_t>(n);
        callbacks_.guard_count = infos_.size();
        callbacks_.mode_count = t.moded ? t.mode_count(of_.adapter) : 0;
        callbacks_.user = this;
        callbacks_.guard_infos = infos_.data();
        callbacks_.flow = [](void* user, rc_mode mode, double time, const double* x, double* dxdt,
                             std::size_t) {
            SystemInC& me = at(user);
            C rate = core(x);
            me.of_.system->flow(me.of_.adapter, static_cast<Mode>(mode), time, core(x), rate);
            std::copy_n(rate.data(), n, dxdt);
            return 0;
        };
        if (!infos_.empty()) add_guards();
        if (t.next_time_event) {
            callbacks_.next_time_event = [](void* user, double time, double* next) {
                *next = at(user).of_.system->next_time_event(at(user).of_.adapter, time);
                return 0;
            };
        }
        if (t.time_reset) {
            callbacks_.time_reset = [](void* user, rc_mode* mode, double time, double* x,
                                       std::size_t) {
                return at(user).edit(mode, x, [&](auto& of, Mode before, C& state) {
                    return of.system->time_reset(of.adapter, before, time, state);
                });
            };
        }
        callbacks_.set_valued = &inclusion_;
    }
    SystemInC(const SystemInC&) = delete;
    SystemInC& operator=(const SystemInC&) = delete;

    [[nodiscard]] const rc_callbacks& callbacks() const noexcept { return callbacks_; }

private:
    [[nodiscard]] static SystemInC& at(void* user) { return *static_cast<SystemInC*>(user); }
    [[nodiscard]] static C core(const double* x)
    {
        C out(static_cast<std::size_t>(n));
        std::copy_n(x, n, out.data());
        return out;
    }
    /// Calls a reset.
    template <class Reset>
    int edit(rc_mode* mode, double* x, const Reset& reset)
    {
        C state = core(x);
        *mode = reset(of_, static_cast<Mode>(*mode), state);
        std::copy_n(state.data(), n, x);
        return 0;
    }

    void describe_guards()
    {
        const auto& t = *of_.system;
        const std::size_t count = t.guard_count ? t.guard_count(of_.adapter) : 0;
        names_.reserve(count);
        for (std::size_t i = 0; i < count; ++i) {
            const GuardInfo given = t.info(of_.adapter, i);
            names_.emplace_back(given.name);
            rc_guard_info info = {};
            info.size = sizeof info;
            info.name = names_.back().c_str();
            info.crossing = static_cast<std::int32_t>(given.crossing);
            info.notifies = !given.resets;
            info.unilateral = given.unilateral;
            info.boolean = given.boolean;
            info.stop_after = given.stop_after;
            infos_.push_back(info);
            stands_for_.push_back(given.reaction == no_reaction ? RC_NO_REACTION : given.reaction);
        }
    }
    void add_guards()
    {
        const auto& t = *of_.system;
        callbacks_.guard = [](void* user, std::size_t which, rc_mode mode, double time,
                              const double* x, std::size_t, double* g) {
            auto& of = at(user).of_;
            *g = of.system->guard(of.adapter, which, static_cast<Mode>(mode), time, core(x));
            return 0;
        };
        if (t.reset) {
            callbacks_.reset = [](void* user, std::size_t which, rc_mode* mode, double time,
                                  double* x, std::size_t) {
                return at(user).edit(mode, x, [&](auto& of, Mode before, C& state) {
                    return of.system->reset(of.adapter, which, before, time, state);
                });
            };
        }
        if (t.rest) {
            callbacks_.rest = [](void* user, std::size_t which, rc_mode* mode, double time,
                                 double* x, std::size_t) {
                return at(user).edit(mode, x, [&](auto& of, Mode before, C& state) {
                    return of.system->rest(of.adapter, which, before, time, state);
                });
            };
        }
        if (t.enabled_in) {
            callbacks_.enabled_in = [](void* user, std::size_t which, rc_mode mode, int* enabled) {
                auto& of = at(user).of_;
                *enabled = of.system->enabled_in(of.adapter, which, static_cast<Mode>(mode));
                return 0;
            };
        }
        if (t.enabled_at) {
            callbacks_.enabled = [](void* user, std::size_t which, rc_mode mode, double time,
                                    const double* x, std::size_t, int* enabled) {
                auto& of = at(user).of_;
                *enabled = of.system->enabled_at(of.adapter, which, static_cast<Mode>(mode), time,
                                                 core(x));
                return 0;
            };
        }
    }

    // --- the inclusion ---

    /// Calls a function with the inclusion of a mode, if it has one.
    template <class Call>
    bool with_set(rc_mode mode, const Call& call) const
    {
        if constexpr (!detail::has_inclusion_by_mode<System>) {
            const Set set = system_.set_valued();
            call(set);
        } else {
            const auto given = system_.set_valued(static_cast<Mode>(mode));
            if constexpr (detail::GivenInclusion<System>::optional) {
                if (!given) return false;
                call(*given);
            } else {
                call(given);
            }
        }
        return true;
    }
    [[nodiscard]] static W vector(const double* w) { return Eigen::Map<const W>(w); }

    void describe_inclusion()
    {
        rc_inclusion& out = inclusion_;
        out.size = sizeof out;
        out.reactions = static_cast<std::size_t>(m);
        if constexpr (detail::has_inclusion_by_mode<System>) find_modes();
        const auto asks = [](std::size_t i) { return i != RC_NO_REACTION; };
        if (std::any_of(stands_for_.begin(), stands_for_.end(), asks)) {
            out.stands_for = stands_for_.data();
        }
        out.smooth = [](void* user, rc_mode mode, double t, const double* w, double* f,
                        std::size_t) {
            at(user).with_set(mode, [&](const Set& set) {
                W force;
                set.smooth(t, vector(w), force);
                std::copy_n(force.data(), n, f);
            });
            return 0;
        };
        out.bounds = [](void* user, rc_mode mode, double t, const double* w, std::size_t,
                        double* lower, double* upper, std::size_t) {
            at(user).with_set(mode, [&](const Set& set) {
                const auto box = set.reaction_set(t, vector(w));
                for (std::size_t i = 0; i < static_cast<std::size_t>(m); ++i) {
                    lower[i] = box.lower(i);
                    upper[i] = box.upper(i);
                }
            });
            return 0;
        };
        if constexpr (HasStaticBound<Set>) {
            out.static_bounds = [](void* user, rc_mode mode, double t, const double* w, std::size_t,
                                   double* bounds, std::size_t) {
                at(user).with_set(mode, [&](const Set& set) {
                    for (int i = 0; i < m; ++i) bounds[i] = set.static_bound(t, vector(w), i);
                });
                return 0;
            };
        }
        if constexpr (requires(const Set& set, R& s) { set.offset(0.0, s); }) add_offset();
        add_matrices();
        add_changes();
    }
    void find_modes()
    {
        const std::size_t modes = of_.system->mode_count(of_.adapter);
        for (std::size_t mode = 0; mode < modes; ++mode) {
            in_modes_.push_back(with_set(mode, [](const Set&) {}) ? 1 : 0);
        }
        inclusion_.in_modes = in_modes_.data();
    }
    void add_offset()
    {
        inclusion_.offset = [](void* user, rc_mode mode, double t, double* s, double* rate,
                               std::size_t) {
            at(user).with_set(mode, [&](const Set& set) {
                R of, change;
                set.offset(t, of);
                if constexpr (requires { set.offset_rate(t, change); }) {
                    set.offset_rate(t, change);
                } else {
                    R later;
                    set.offset(t + 1e-6, later);
                    set.offset(t - 1e-6, change);
                    change = (later - change) / 2e-6;
                }
                std::copy_n(of.data(), m, s);
                std::copy_n(change.data(), m, rate);
            });
            return 0;
        };
    }
    /// By rows, of the first mode with an inclusion.
    void add_matrices()
    {
        rc_mode mode = 0;
        while (!in_modes_.empty() && in_modes_[mode] == 0) ++mode;
        with_set(mode, [&](const Set& set) {
            if constexpr (requires(Eigen::Matrix<double, n, n> & a) { set.mass(a); }) {
                Eigen::Matrix<double, n, n> a;
                set.mass(a);
                keep(a, mass_, inclusion_.mass);
            }
            using E = Eigen::Matrix<double, m, n, m == 1 && n != 1 ? Eigen::RowMajor : 0>;
            if constexpr (requires(E & e) { set.observe(e); }) {
                E e;
                set.observe(e);
                keep(e, observe_, inclusion_.observe);
            }
            using G = Eigen::Matrix<double, n, m, n == 1 && m != 1 ? Eigen::RowMajor : 0>;
            if constexpr (requires(G & g) { set.act(g); }) {
                G g;
                set.act(g);
                keep(g, act_, inclusion_.act);
            }
        });
    }
    template <class Matrix>
    static void keep(const Matrix& from, std::vector<double>& numbers, const double*& out)
    {
        for (Eigen::Index i = 0; i < from.rows(); ++i) {
            for (Eigen::Index j = 0; j < from.cols(); ++j) numbers.push_back(from(i, j));
        }
        out = numbers.data();
    }
    void add_changes()
    {
        if constexpr (detail::ChangesMode<System, X> || detail::ChangesState<System, X>) {
            inclusion_.change = [](void* user, std::size_t which, std::int32_t kind, rc_mode* mode,
                                   double t, double* x, std::size_t) {
                X state;
                std::copy_n(x, n, state.data());
                const auto change = static_cast<EventKind>(kind);
                if constexpr (detail::ChangesMode<System, X>) {
                    *mode =
                        at(user).system_.change(which, change, static_cast<Mode>(*mode), t, state);
                } else {
                    at(user).system_.change(which, change, t, state);
                }
                std::copy_n(state.data(), n, x);
                return 0;
            };
        }
        if constexpr (detail::StartsInMode<System, X> || detail::StartsMode<System, X>) {
            inclusion_.start_mode = [](void* user, rc_mode* mode, double t, const double* x,
                                       std::size_t) {
                X state;
                std::copy_n(x, n, state.data());
                if constexpr (detail::StartsInMode<System, X>) {
                    *mode = at(user).system_.start_mode(static_cast<Mode>(*mode), t, state);
                } else {
                    *mode = at(user).system_.start_mode(t, state);
                }
                return 0;
            };
        }
    }

    const System& system_;
    detail::RunComponents<System, X, ErrorControlled<Dopri5>, Extremum, Newton> parts_;
    detail::RunBindings<C> of_;
    std::vector<std::string> names_;
    std::vector<rc_guard_info> infos_;
    std::vector<std::size_t> stands_for_;
    std::vector<std::int32_t> in_modes_;
    std::vector<double> mass_, observe_, act_;
    rc_inclusion inclusion_{};
    rc_callbacks callbacks_{};
};

/// A simulation of such a system.
class SimulationInC {
public:
    SimulationInC(const rc_callbacks& callbacks, const double* x0, const Options& options)
    {
        rc_options given;
        rc_system* system = nullptr;
        rc_options_default(&given, sizeof given);
        given.t_end = options.t_end;
        given.rtol = options.rtol;
        given.atol = options.atol;
        given.h_max = options.h_max;
        given.mode = options.mode;
        given.stop_at_event = options.stop_at_event;
        given.sample_times = options.sample_times.data();
        given.sample_count = options.sample_times.size();
        EXPECT_EQ(rc_system_new(&callbacks, &system), RC_OK) << rc_last_error();
        EXPECT_EQ(rc_simulation_new(system, x0, callbacks.dimension, &given, &of_), RC_OK)
            << rc_last_error();
        rc_system_free(system);
    }
    ~SimulationInC() { rc_simulation_free(of_); }
    SimulationInC(const SimulationInC&) = delete;
    SimulationInC& operator=(const SimulationInC&) = delete;

    [[nodiscard]] rc_simulation* get() const noexcept { return of_; }

private:
    rc_simulation* of_ = nullptr;
};

/// Runs a system through C, whole and by steps with a new simulation after every tenth, and
/// compares it with a run in C++: the states up to `error`, and the events up to `error` seconds.
template <class System, class X>
void expect_same_in_c(const System& system, const X& x0, const Options& options, const Run<X>& run,
                      double error)
{
    const SystemInC<System, X> in_c(system, x0);
    const SimulationInC whole(in_c.callbacks(), x0.data(), options);
    ASSERT_EQ(rc_run(whole.get()), RC_OK) << rc_last_error();
    EXPECT_EQ(rc_outcome_name(rc_outcome(whole.get())), name(run.outcome));
    for (std::size_t i = 0; i < x0.size(); ++i) {
        EXPECT_NEAR(rc_state(whole.get())[i], run.x[i], error) << i;
    }
    ASSERT_EQ(rc_event_count(whole.get()), run.events.size());
    for (std::size_t k = 0; k < run.events.size(); ++k) {
        rc_event event = {};
        event.size = sizeof event;
        ASSERT_EQ(rc_event_at(whole.get(), k, &event), RC_OK);
        const Event<X>& expected = run.events[k];
        EXPECT_NEAR(event.t, expected.t, error) << k;
        EXPECT_EQ(event.kind, static_cast<std::int32_t>(expected.kind)) << k;
        EXPECT_EQ(event.guard, expected.guard) << k;
        EXPECT_EQ(event.reaction, expected.reaction) << k;
    }
    ASSERT_EQ(rc_sample_count(whole.get()), run.trajectory.t.size());
    for (std::size_t k = 0; k < run.trajectory.t.size(); ++k) {
        double t = 0;
        const double* x = nullptr;
        ASSERT_EQ(rc_sample_at(whole.get(), k, &t, &x), RC_OK);
        EXPECT_EQ(t, run.trajectory.t[k]);
        for (std::size_t i = 0; i < x0.size(); ++i) {
            EXPECT_NEAR(x[i], run.trajectory.x[k][i], error) << k << ' ' << i;
        }
    }

    auto parts = std::make_unique<SimulationInC>(in_c.callbacks(), x0.data(), options);
    int goes_on = 1;
    for (int steps = 1; goes_on != 0; ++steps) {
        ASSERT_EQ(rc_step(parts->get(), &goes_on), RC_OK) << rc_last_error();
        if (steps % 10 != 0) continue;
        std::size_t size = 0;
        ASSERT_EQ(rc_save(parts->get(), nullptr, &size), RC_OK);
        std::vector<char> bytes(size);
        ASSERT_EQ(rc_save(parts->get(), bytes.data(), &size), RC_OK);
        parts = std::make_unique<SimulationInC>(in_c.callbacks(), x0.data(), options);
        ASSERT_EQ(rc_restore(parts->get(), bytes.data(), size), RC_OK) << rc_last_error();
    }
    for (std::size_t i = 0; i < x0.size(); ++i) {
        EXPECT_EQ(rc_state(parts->get())[i], rc_state(whole.get())[i]) << i;
    }
}

}  // namespace ricochet
