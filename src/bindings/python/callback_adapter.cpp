// The functions of a system of callbacks, as a run calls them.
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <memory>
#include <stdexcept>
#include <utility>
#include <vector>

#include "callbacks.hpp"
#include "formula_adapter.hpp"
#include "implicit.hpp"
#include "numbers.hpp"
#include "ricochet/detail/guard_view.hpp"
#include "ricochet/taylor/taylor.hpp"

namespace ricochet::python {

template <>
void FormulaAdapter<detail::TaylorOf<0>>::choose_method(detail::RunBindings<State>& setup)
{
    detail::step_by_series<FormulaSystem, State, 0>(setup);
}

namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();

}  // namespace

/// Adapter of one run to a system of callbacks, with the arrays that its callbacks are shown.
class CallbackAdapter final : public RunAdapter {
    using Table = detail::SystemTable<State>;
    using Guards = std::vector<CallbackGuard>;

public:
    /// @param parameters  of formulas
    explicit CallbackAdapter(const CallbackSource& source, const double* parameters = nullptr)
        : source_(source), parameters_(parameters), x_(source.as_list_), dxdt_(source.as_list_)
    {
    }

    [[nodiscard]] const Table& table() const noexcept override { return source_.table_; }
    [[nodiscard]] void* adapter() noexcept override { return this; }
    [[nodiscard]] bool is_free() const noexcept override { return source_.free_; }
    [[nodiscard]] bool has_inclusion() const noexcept override
    {
        return source_.inclusion_.has_value();
    }
    void add_inclusions(detail::PhasedSetup<State>& setup, std::size_t n,
                        const Options& options) override;
    bool jacobian(Mode mode, double t, const State& x, std::span<double> rows) override
    {
        const Function& function = source_.jacobian_;
        if (!function) return false;
        if (function.address) {
            reinterpret_cast<CompiledFlow>(function.address)(mode, t, x.data(), rows.data(),
                                                             x.size(), function.user);
            return true;
        }
        const Ref result = call(function, mode, t, x_.show(x));
        read_matrix(result.get(), source_.jacobian_title_, {x.size(), x.size()}, rows.data());
        return true;
    }

    static void fill(Table& table, const CallbackSource& source)
    {
        table.moded = source.moded_;
        table.flow = [](void* adapter, Mode mode, double t, const State& x, State& dxdt) {
            return at(adapter).flow(mode, t, x, dxdt);
        };
        table.mode_count = [](void* adapter) { return at(adapter).source_.mode_count_; };
        table.guard_count = [](void* adapter) { return at(adapter).source_.guards_.size(); };
        table.name = [](void* adapter) { return at(adapter).name(); };
        fill_time_events(table, source);
        const Guards& guards = source.guards_;
        if (guards.empty()) return;
        fill_guards(table, source);
        fill_enabled(table, guards);
        fill_resets(table, source);
        if (every(guards, &CallbackGuard::speed_bound)) fill_bounds(table, guards);
    }

private:
    class Inclusion;

    /// Whether any guard, or every one, has a function or a property.
    template <class Member>
    [[nodiscard]] static bool any(const Guards& guards, Member member)
    {
        return std::any_of(guards.begin(), guards.end(),
                           [&](const CallbackGuard& guard) { return bool(guard.*member); });
    }
    template <class Member>
    [[nodiscard]] static bool every(const Guards& guards, Member member)
    {
        return std::all_of(guards.begin(), guards.end(), [&](const CallbackGuard& guard) {
            return bool(std::invoke(member, guard));
        });
    }

    // --- parts of the table ---

    static void fill_time_events(Table& table, const CallbackSource& source)
    {
        if (source.times_) {
            table.next_time_event = [](void* adapter, double t) {
                return at(adapter).source_.times_->next(t);
            };
            table.previous_time_event = [](void* adapter, double t) {
                return at(adapter).source_.times_->previous(t);
            };
            table.time_event_count = [](void* adapter, double t) {
                return at(adapter).source_.times_->count(t);
            };
        } else if (source.next_time_event_ || source.next_time_event_at_) {
            if (source.next_time_event_at_) {
                table.next_time_event_at = [](void* adapter, Mode mode, double t, const State& x) {
                    return at(adapter).timer(mode, t, x);
                };
            } else {
                table.next_time_event = [](void* adapter, double t) {
                    return at(adapter).time_event(at(adapter).source_.next_time_event_, t,
                                                  infinity);
                };
            }
            if (source.previous_time_event_) {
                table.previous_time_event = [](void* adapter, double t) {
                    return at(adapter).time_event(at(adapter).source_.previous_time_event_, t,
                                                  -infinity);
                };
            }
        }
        if (source.time_reset_) {
            table.time_reset = [](void* adapter, Mode mode, double t, State& x) {
                return at(adapter).time_reset(mode, t, x);
            };
        }
    }

    static void fill_guards(Table& table, const CallbackSource& source)
    {
        table.guarded = true;
        table.guard_alone = !source.guard_values_;
        table.rated = every(source.guards_, &CallbackGuard::is_rated);
        table.calls_of_rate = table.rated ? 0 : 2;
        table.info = [](void* adapter, std::size_t which) {
            return at(adapter).source_.guards_[which].info;
        };
        table.guards = [](void* adapter, Mode mode, double t, const State& x, std::span<double> g) {
            at(adapter).guards(mode, t, x, g);
        };
        table.guard = [](void* adapter, std::size_t which, Mode mode, double t, const State& x) {
            return at(adapter).guard(which, mode, t, x);
        };
        table.rate = [](void* adapter, GuardInMode of, detail::ScaledTime time, const State& x,
                        const State& dxdt) { return at(adapter).rate(of, time, x, dxdt); };
        if (table.rated) {
            table.each_rate = [](void* adapter, const detail::Along<State>& motion,
                                 std::span<double> rates) {
                for (std::size_t i = 0; i < rates.size(); ++i) {
                    rates[i] =
                        at(adapter).is_in(i, motion.mode)
                            ? at(adapter).closed_rate(i, motion.mode, motion.t, motion.x, motion.s)
                            : 0;
                }
            };
        }
    }

    static void fill_enabled(Table& table, const Guards& guards)
    {
        if (std::any_of(guards.begin(), guards.end(),
                        [](const CallbackGuard& guard) { return !guard.in_mode.empty(); })) {
            table.enabled_in = [](void* adapter, std::size_t which, Mode mode) {
                return at(adapter).is_in(which, mode);
            };
        }
        if (any(guards, &CallbackGuard::enabled)) {
            table.enabled_at = [](void* adapter, std::size_t which, Mode mode, double t,
                                  const State& x) {
                return at(adapter).enabled(which, mode, t, x);
            };
        }
    }

    static void fill_resets(Table& table, const CallbackSource& source)
    {
        const Guards& guards = source.guards_;
        if (source.reset_set_) {
            table.reset_set = [](void* adapter, const FiredGuards& fired, Mode mode, double t,
                                 State& x) { return at(adapter).reset_set(fired, mode, t, x); };
        } else if (any(guards, &CallbackGuard::reset)) {
            table.reset = [](void* adapter, std::size_t which, Mode mode, double t, State& x) {
                const CallbackGuard& guard = at(adapter).source_.guards_[which];
                if (guard.directed) return at(adapter).reset_by_direction(guard, mode, t, x);
                return at(adapter).edit(guard.reset, "reset of ", guard.owner, mode, t, x);
            };
            if (any(guards, &CallbackGuard::directed)) {
                table.tell_direction = [](void* adapter, Crossing direction) {
                    at(adapter).direction_ = direction;
                };
            }
        }
        if (any(guards, &CallbackGuard::rest)) {
            table.rest = [](void* adapter, std::size_t which, Mode mode, double t, State& x) {
                const CallbackGuard& guard = at(adapter).source_.guards_[which];
                return at(adapter).edit(guard.rest, "rest of ", guard.owner, mode, t, x, false);
            };
        }
    }

    static void fill_bounds(Table& table, const Guards& guards)
    {
        table.bounded = true;
        table.lipschitz = [](void* adapter, std::size_t which) {
            return at(adapter).source_.guards_[which].lipschitz;
        };
        table.speed_bound = &bound<&CallbackGuard::speed_bound>;
        table.acceleration_bound = &bound<&CallbackGuard::acceleration_bound>;
        if (any(guards, &CallbackGuard::lower_bound)) {
            table.lower_bound = &bound<&CallbackGuard::lower_bound>;
        }
        if (any(guards, &CallbackGuard::upper_bound)) {
            table.upper_bound = &bound<&CallbackGuard::upper_bound>;
        }
    }

    [[nodiscard]] static CallbackAdapter& at(void* adapter) noexcept
    {
        return *static_cast<CallbackAdapter*>(adapter);
    }

    // --- calls ---

    /// function([mode,] t, further..., arguments...)
    template <class... Further>
    [[nodiscard]] Ref call(const Function& function, Mode mode, double t,
                           const Further&... further) const
    {
        std::array<PyObject*, most_arguments> stack{};
        std::size_t count = 1;  // vectorcall reserves the first place
        if (source_.moded_) {
            if (mode >= source_.mode_count_) {
                raise(PyExc_ValueError, "found the mode " + std::to_string(mode) +
                                            ", expected one below " +
                                            std::to_string(source_.mode_count_));
            }
            stack[count++] = PyList_GET_ITEM(source_.mode_list_.get(), mode);
        }
        const Ref time = checked(PyFloat_FromDouble(t));
        stack[count++] = time.get();
        ((stack[count++] = further), ...);
        for (const Ref& argument : source_.arguments_) stack[count++] = argument.get();
        return checked(PyObject_Vectorcall(function.object.get(), stack.data() + 1,
                                           (count - 1) | PY_VECTORCALL_ARGUMENTS_OFFSET, nullptr));
    }

    [[nodiscard]] std::string name() const
    {
        return source_.name_.empty() ? "Python" : source_.name_;
    }

    bool flow(Mode mode, double t, const State& x, State& dxdt)
    {
        const Function& function = source_.flow_;
        if (dxdt.size() != x.size()) dxdt.resize(x.size());
        if (function.is_free()) {
            watch().tick();
            function.flow(mode, t, x.data(), dxdt.data(), x.size(), parameters_);
            return true;
        }
        const Ref result = call(function, mode, t, x_.show(x));
        const Numbers numbers(result.get(), "", source_.flow_title_);
        if (numbers.size() != x.size()) {
            raise(PyExc_ValueError, source_.flow_title_ + " returned " +
                                        std::to_string(numbers.size()) +
                                        " numbers for a state of " + std::to_string(x.size()));
        }
        numbers.copy(dxdt.data());
        return true;
    }

    [[nodiscard]] bool is_in(std::size_t which, Mode mode) const
    {
        const auto& in_mode = source_.guards_[which].in_mode;
        return in_mode.empty() || (mode < in_mode.size() && in_mode[mode]);
    }

    void guards(Mode mode, double t, const State& x, std::span<double> g)
    {
        if (!source_.guard_values_) {
            for (std::size_t i = 0; i < g.size(); ++i) {
                // a guard that is not examined in this mode may have no value there
                g[i] = is_in(i, mode) ? guard(i, mode, t, x) : 1;
            }
            return;
        }
        const Ref result = call(source_.guard_values_, mode, t, x_.show(x));
        const Numbers numbers(result.get(), "guard_values", no_guard_);
        if (numbers.size() != g.size()) {
            raise(PyExc_ValueError, "guard_values returned " + std::to_string(numbers.size()) +
                                        " numbers for " + std::to_string(g.size()) + " guards");
        }
        numbers.copy_guards(g.data());
        for (std::size_t i = 0; i < g.size(); ++i) g[i] = by_its_sign(i, g[i]);
    }

    /// A zero of a guard of which only the sign has a meaning is false, as in an array that holds
    /// truths and numbers.
    [[nodiscard]] double by_its_sign(std::size_t which, double g) const
    {
        return g == 0 && source_.guards_[which].info.boolean ? -1 : g;
    }

    [[nodiscard]] double guard(std::size_t which, Mode mode, double t, const State& x)
    {
        if (source_.guard_values_) {
            values_.resize(source_.guards_.size());
            guards(mode, t, x, values_);
            return values_[which];
        }
        const CallbackGuard& guard = source_.guards_[which];
        if (guard.value.is_free()) {
            return by_its_sign(which, guard.value.value(mode, t, x.data(), x.size(), parameters_));
        }
        return by_its_sign(which, number(guard.value, "", guard.title, mode, t, x));
    }

    [[nodiscard]] double number(const Function& function, const char* what, const std::string& of,
                                Mode mode, double t, const State& x)
    {
        const Ref result = call(function, mode, t, x_.show(x));
        if (PyFloat_Check(result.get())) return PyFloat_AS_DOUBLE(result.get());
        return as_guard(result.get(), what + of);
    }

    [[nodiscard]] double closed_rate(std::size_t which, Mode mode, double t, const State& x,
                                     const State& dxdt)
    {
        const CallbackGuard& guard = source_.guards_[which];
        if (guard.derived) {
            return guard.derived->value_along(mode, t, x.data(), dxdt.data(), parameters_);
        }
        if (guard.rate.address) {
            return reinterpret_cast<CompiledRate>(guard.rate.address)(
                mode, t, x.data(), dxdt.data(), x.size(), guard.rate.user);
        }
        const Ref result = call(guard.rate, mode, t, x_.show(x), dxdt_.show(dxdt));
        return as_guard(result.get(), "rate of " + guard.owner);
    }

    /// In closed form where that is finite, else the difference along the flow; see
    /// `detail::GuardView::rate`.
    [[nodiscard]] double rate(GuardInMode of, detail::ScaledTime time, const State& x,
                              const State& dxdt)
    {
        const double t = time.t;
        if (source_.guards_[of.which].is_rated()) {
            const double known = of.backward
                                     ? -closed_rate(of.which, of.mode, t, x, detail::negated(dxdt))
                                     : closed_rate(of.which, of.mode, t, x, dxdt);
            if (std::isfinite(known)) return known;
        }
        const double delta = 1e-5 * time.scale;
        const auto moved = [&](double s) {
            there_ = x;
            for (std::size_t i = 0; i < x.size(); ++i) there_[i] = x[i] + s * dxdt[i];
            return guard(of.which, of.mode, of.backward ? t - s : t + s, there_);
        };
        const double ahead = moved(delta);
        const double behind = moved(-delta);
        const double central = (ahead - behind) / (2 * delta);
        if (std::isfinite(central)) return central;
        return detail::one_sided(guard(of.which, of.mode, t, x), ahead, behind, delta);
    }

    [[nodiscard]] bool enabled(std::size_t which, Mode mode, double t, const State& x)
    {
        const CallbackGuard& guard = source_.guards_[which];
        if (!guard.enabled) return true;
        const Ref result = call(guard.enabled, mode, t, x_.show(x));
        // None is what a function without a return statement returns.
        const int truth = PyNumber_Check(result.get()) ? PyObject_IsTrue(result.get()) : -1;
        if (truth >= 0) return truth != 0;
        if (PyErr_Occurred() && !PyErr_ExceptionMatches(PyExc_ValueError)) throw PythonError();
        PyErr_Clear();
        raise(PyExc_TypeError, "enabled of " + guard.owner + " returned " + type_of(result.get()) +
                                   ", expected True or False");
    }

    template <Function CallbackGuard::*member>
    [[nodiscard]] static double bound(void* adapter, std::size_t which, Mode mode, double t,
                                      const State& x)
    {
        const CallbackGuard& guard = at(adapter).source_.guards_[which];
        const Function& function = guard.*member;
        if (!function) {
            return member == &CallbackGuard::acceleration_bound ? 0
                   : member == &CallbackGuard::lower_bound      ? -infinity
                                                                : infinity;
        }
        if (function.is_free()) return function.value(mode, t, x.data(), x.size(), nullptr);
        return at(adapter).number(function, "bound of ", guard.owner, mode, t, x);
    }

    // --- resets ---

    /// x⁻ becomes x⁺; returns the mode after it.
    /// @param may_stop  whether the function may end the run
    [[nodiscard]] Mode edit(const Function& function, const char* what, const std::string& of,
                            Mode mode, double t, State& x, bool may_stop = true)
    {
        if (!function) return mode;
        if (function.is_free()) {
            const Mode next = function.edit(mode, t, x.data(), x.size(), parameters_);
            return source_.moded_ ? next : mode;
        }
        if (!may_stop) {
            const Ref result = call(function, mode, t, x_.show(x));
            return take_place(result.get(), what, of, mode, x);
        }
        const Ref result = call_reset(function, mode, t, x_.show(x));
        return take_result(result.get(), what, of, mode, x);
    }

    [[nodiscard]] Mode reset_by_direction(const CallbackGuard& guard, Mode mode, double t, State& x)
    {
        const Ref direction = checked(PyLong_FromLong(direction_ == Crossing::rising ? 1 : -1));
        const Ref result = call_reset(guard.reset, mode, t, x_.show(x), direction.get());
        return take_result(result.get(), "reset of ", guard.owner, mode, x);
    }

    [[nodiscard]] static bool is_stop(PyObject* object)
    {
        const Ref& known = stop_class();
        return known && PyObject_IsInstance(object, known.get()) == 1;
    }

    /// What a reset has returned; the `Stop`, if it has raised one.
    template <class... Further>
    [[nodiscard]] Ref call_reset(const Function& function, Mode mode, double t,
                                 const Further&... further) const
    {
        try {
            return call(function, mode, t, further...);
        } catch (const PythonError& error) {
            if (!is_stop(error.value())) throw;
            return Ref::share(error.value());
        }
    }

    /// The mode after a reset, whose state is taken into x.
    /// @throws StopRun if it has ended the run
    [[nodiscard]] Mode take_result(PyObject* result, const char* what, const std::string& of,
                                   Mode mode, State& x)
    {
        if (!is_stop(result)) return take_place(result, what, of, mode, x);
        const Ref reason = checked(PyObject_GetAttrString(result, "reason"));
        const Ref after = checked(PyObject_GetAttrString(result, "after"));
        const char* text = PyUnicode_AsUTF8(reason.get());
        if (!text) throw PythonError();
        const Mode next =
            after.get() == Py_None ? mode : take_place(after.get(), what, of, mode, x);
        throw StopRun(text, next);
    }

    [[nodiscard]] Mode reset_set(const FiredGuards& fired, Mode mode, double t, State& x)
    {
        const bool on_time = fired.time_event();
        const Ref list = checked(PyList_New(static_cast<Py_ssize_t>(fired.size() + on_time)));
        for (std::size_t i = 0; i < fired.size(); ++i) {
            PyList_SET_ITEM(list.get(), static_cast<Py_ssize_t>(i), PyLong_FromSize_t(fired[i]));
        }
        if (on_time) {
            PyList_SET_ITEM(list.get(), static_cast<Py_ssize_t>(fired.size()),
                            PyUnicode_FromString("time"));
        }
        const Ref result = call_reset(source_.reset_set_, mode, t, x_.show(x), list.get());
        return take_result(result.get(), "reset_set", no_guard_, mode, x);
    }

    [[nodiscard]] Mode time_reset(Mode mode, double t, State& x)
    {
        return edit(source_.time_reset_, "time_reset", no_guard_, mode, t, x);
    }

    /// A state; with modes a mode, or a tuple (mode, state).
    [[nodiscard]] Mode take_place(PyObject* result, const char* what, const std::string& of,
                                  Mode mode, State& x)
    {
        if (!source_.moded_) {
            take_state(result, what, of, x);
            return mode;
        }
        PyObject* name = result;
        PyObject* state = nullptr;
        if (PyTuple_Check(result)) {
            if (PyTuple_GET_SIZE(result) != 2) {
                raise(PyExc_ValueError, what + of + " returned a tuple of " +
                                            std::to_string(PyTuple_GET_SIZE(result)) +
                                            ", expected (mode, state)");
            }
            name = PyTuple_GET_ITEM(result, 0);
            state = PyTuple_GET_ITEM(result, 1);
        }
        PyObject* number = PyDict_GetItemWithError(source_.mode_numbers_.get(), name);
        if (!number) {
            PyErr_Clear();
            if (state && PyDict_GetItemWithError(source_.mode_numbers_.get(), state)) {
                raise(PyExc_ValueError,
                      what + of + " returned (state, mode), expected (mode, state)");
            }
            PyErr_Clear();
            const Ref text = checked(PyObject_Repr(name));
            const Ref modes = checked(PyObject_Repr(source_.mode_list_.get()));
            raise(PyExc_ValueError, what + of + " returned " + PyUnicode_AsUTF8(text.get()) +
                                        ", expected a mode or (mode, state), the modes being " +
                                        PyUnicode_AsUTF8(modes.get()));
        }
        if (state) take_state(state, what, of, x);
        return static_cast<Mode>(PyLong_AsUnsignedLong(number));
    }

    void take_state(PyObject* result, const char* what, const std::string& of, State& x)
    {
        const Numbers numbers(result, what, of);
        const bool may_change = source_.table_.changes_dimension || source_.moded_;
        if (numbers.size() != x.size() && (numbers.size() == 0 || !may_change)) {
            raise(PyExc_ValueError, what + of + " returned " + std::to_string(numbers.size()) +
                                        " numbers for a state of " + std::to_string(x.size()));
        }
        x.resize(numbers.size());
        numbers.copy(x.data());
    }

    /// The mode in which the system's own flow is followed again.
    [[nodiscard]] Mode mode_after(Mode mode, double t, const State& x)
    {
        const Ref result = call(source_.inclusion_->start_mode, mode, t, x_.show(x));
        State same = x;
        return take_place(result.get(), "start_mode of set_valued", no_guard_, mode, same);
    }
    /// The reset of a change of a reaction, called with its number and kind behind the state.
    [[nodiscard]] Mode change(std::size_t reaction, EventKind kind, Mode mode, double t, State& x)
    {
        const Ref which = checked(PyLong_FromSize_t(reaction));
        const Ref what = checked(PyUnicode_FromString(ricochet::name(kind).data()));
        const Ref result =
            call(source_.inclusion_->change, mode, t, x_.show(x), which.get(), what.get());
        if (result.get() == Py_None) return mode;
        return take_place(result.get(), "change of set_valued", no_guard_, mode, x);
    }

    [[nodiscard]] double timer(Mode mode, double t, const State& x)
    {
        const Ref result = call(source_.next_time_event_at_, mode, t, x_.show(x));
        return result.get() == Py_None ? infinity : as_guard(result.get(), "next_time_event");
    }

    [[nodiscard]] double time_event(const Function& function, double t, double never)
    {
        std::array<PyObject*, most_arguments> stack{};
        std::size_t count = 1;
        const Ref time = checked(PyFloat_FromDouble(t));
        stack[count++] = time.get();
        for (const Ref& argument : source_.arguments_) stack[count++] = argument.get();
        const Ref result =
            checked(PyObject_Vectorcall(function.object.get(), stack.data() + 1,
                                        (count - 1) | PY_VECTORCALL_ARGUMENTS_OFFSET, nullptr));
        return result.get() == Py_None ? never : as_guard(result.get(), "next_time_event");
    }

    const CallbackSource& source_;
    const double* parameters_;
    Crossing direction_ = Crossing::falling;  ///< of the guard whose reset comes next
    ShownArray x_, dxdt_;
    State there_;
    std::vector<double> values_;
    const std::string no_guard_;
};

#ifdef RICOCHET_WITH_NONSMOOTH

/// The inclusion of a system in one mode.
class CallbackAdapter::Inclusion final : public detail::SizedInclusion {
public:
    Inclusion(CallbackAdapter& adapter, Mode mode, std::size_t size)
        : adapter_(adapter), of_(*adapter.source_.inclusion_), mode_(mode), size_(size)
    {
    }

    [[nodiscard]] std::size_t size() const noexcept override { return size_; }
    [[nodiscard]] std::size_t reactions() const noexcept override { return of_.reactions; }
    void smooth(double t, const double* w, double* f) const override
    {
        read(adapter_.call(of_.smooth, mode_, t, show(w)).get(), "smooth", size_, f);
    }
    void bounds(double t, const double* w, double* lower, double* upper) const override
    {
        const Ref result = adapter_.call(of_.bounds, mode_, t, show(w));
        if (!PyTuple_Check(result.get()) || PyTuple_GET_SIZE(result.get()) != 2) {
            raise(PyExc_TypeError, "bounds of set_valued returned " + type_of(result.get()) +
                                       ", expected a tuple (lower, upper)");
        }
        read(PyTuple_GET_ITEM(result.get(), 0), "lower bounds", reactions(), lower);
        read(PyTuple_GET_ITEM(result.get(), 1), "upper bounds", reactions(), upper);
    }
    [[nodiscard]] bool has_offset() const noexcept override
    {
        return static_cast<bool>(of_.offset);
    }
    void offset(double t, double* s) const override
    {
        if (of_.offset) read(adapter_.call(of_.offset, mode_, t).get(), "offset", reactions(), s);
    }
    void offset_rate(double t, double* rate) const override
    {
        if (of_.offset_rate) {
            read(adapter_.call(of_.offset_rate, mode_, t).get(), "offset_rate", reactions(), rate);
        }
    }
    [[nodiscard]] const detail::SizedMatrices& matrices() const noexcept override
    {
        return of_.matrices;
    }
    [[nodiscard]] bool has_static_bounds() const noexcept override
    {
        return static_cast<bool>(of_.static_bounds);
    }
    void static_bounds(double t, const double* w, double* bounds) const override
    {
        read(adapter_.call(of_.static_bounds, mode_, t, show(w)).get(), "static_bounds",
             reactions(), bounds);
    }

private:
    [[nodiscard]] PyObject* show(const double* w) const
    {
        adapter_.there_.assign(w, w + size_);
        return adapter_.x_.show(adapter_.there_);
    }
    /// Writes `count` numbers; a number alone is an array of one.
    static void read(PyObject* result, const char* what, std::size_t count, double* out)
    {
        static const std::string of = " of set_valued";
        if (PyFloat_Check(result) || PyLong_Check(result)) {
            if (count == 1) return static_cast<void>(*out = as_guard(result, what + of));
        }
        const Numbers numbers(result, what, of);
        if (numbers.size() != count) {
            raise(PyExc_ValueError, what + of + " returned " + std::to_string(numbers.size()) +
                                        " numbers, expected " + std::to_string(count));
        }
        numbers.copy(out);
    }

    CallbackAdapter& adapter_;
    const CallbackInclusion& of_;
    Mode mode_;
    std::size_t size_;
};

void CallbackAdapter::add_inclusions(detail::PhasedSetup<State>& setup, std::size_t n,
                                     const Options& options)
{
    const CallbackInclusion& of = *source_.inclusion_;
    if (of.components != 0 && of.components != n) {
        throw std::invalid_argument("set_valued: found matrices for " +
                                    std::to_string(of.components) + " components, expected " +
                                    std::to_string(n) + ", those of x0");
    }
    if (of.matrices.observe.empty() && of.reactions > n) {
        throw std::invalid_argument("set_valued: found " + std::to_string(of.reactions) +
                                    " reactions of " + std::to_string(n) +
                                    " components and no observe, expected the matrix");
    }
    const detail::BranchPhasesOptions solving = detail::branch_options(options);
    const std::size_t modes = source_.moded_ ? source_.mode_count_ : 1;
    if (modes > detail::most_inclusions) {
        throw std::invalid_argument("set_valued: found " + std::to_string(modes) +
                                    " modes, expected at most " +
                                    std::to_string(detail::most_inclusions));
    }
    for (std::size_t mode = 0; mode < modes; ++mode) {
        detail::Owner<detail::BranchPhases> phases;
        if (of.in_mode.empty() || of.in_mode[mode]) {
            phases = detail::make_branch_phases(
                detail::Shared<const detail::SizedInclusion>::make<Inclusion>(
                    *this, static_cast<Mode>(mode), n),
                solving);
        }
        setup.inclusions.push_back(std::move(phases));
    }
    setup.by_mode = source_.moded_;
    if (of.start_mode) {
        setup.start_mode = [](void* adapter, Mode mode, double t, const State& x) {
            return at(adapter).mode_after(mode, t, x);
        };
    }
    if (of.change) {
        setup.change = [](void* adapter, std::size_t reaction, EventKind kind, Mode mode, double t,
                          State& x) { return at(adapter).change(reaction, kind, mode, t, x); };
    }
}

#else

void CallbackAdapter::add_inclusions(detail::PhasedSetup<State>& /*setup*/, std::size_t /*n*/,
                                     const Options& /*options*/)
{
}

#endif

void CallbackSource::fill_table()
{
    CallbackAdapter::fill(table_, *this);
}

void CallbackSource::require_size(const State& x0, const double* parameters) const
{
    if (!flow_.formula) return;
    if (parameter_count_ > 0 && !parameters) {
        throw std::invalid_argument(
            "formula: found symbols of the parameters of an ensemble in a run, expected numbers");
    }
    const std::size_t expected = flow_.formula->in(0).components();
    if (x0.size() == expected) return;
    throw std::invalid_argument("x0: found " + std::to_string(x0.size()) +
                                " components for a formula of " + std::to_string(expected));
}

std::unique_ptr<RunAdapter> CallbackSource::open(const State& x0) const
{
    require_size(x0);
    return std::make_unique<CallbackAdapter>(*this);
}

std::unique_ptr<RunAdapter> CallbackSource::open_by_series(const State& x0) const
{
    Request request;
    request.by_series = true;
    return open_for(request, x0);
}

std::unique_ptr<RunAdapter> CallbackSource::open_implicit(const State& x0) const
{
    Request request;
    request.implicit = true;
    return open_for(request, x0);
}

std::unique_ptr<RunAdapter> CallbackSource::open_for(const Request& request, const State& x0) const
{
    require_size(x0, request.parameters);
    auto callbacks = std::make_unique<CallbackAdapter>(*this, request.parameters);
    if (request.by_series) {
        if (!series_) return Source::open_by_series(x0);
        return std::make_unique<FormulaAdapter<detail::TaylorOf<0>>>(std::move(callbacks),
                                                                     series_for(request), x0);
    }
    if (!request.implicit) return callbacks;
    if (!series_) return implicit_adapter(std::move(callbacks), x0);
    return implicit_formula_adapter(std::move(callbacks), series_for(request), x0);
}

}  // namespace ricochet::python
