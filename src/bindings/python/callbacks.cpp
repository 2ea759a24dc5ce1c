#define NPY_NO_DEPRECATED_API NPY_1_7_API_VERSION
#include "callbacks.hpp"

#include <numpy/arrayobject.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <stdexcept>
#include <utility>

namespace ricochet::python {

namespace {

constexpr std::size_t most_arguments = 32;
constexpr double infinity = std::numeric_limits<double>::infinity();

/// NumPy's functions, found once. (`import_array` returns from the function it stands in.)
bool has_numpy()
{
    static const bool found = [] { return _import_array() >= 0; }();
    return found;
}

[[noreturn]] void raise(PyObject* type, const std::string& sentence)
{
    PyErr_SetString(type, sentence.c_str());
    throw PythonError();
}

[[nodiscard]] std::string type_of(PyObject* object)
{
    return object == Py_None ? "None" : Py_TYPE(object)->tp_name;
}

[[nodiscard]] Ref item(PyObject* dictionary, const char* key)
{
    PyObject* found = PyDict_GetItemString(dictionary, key);  // borrowed
    return Ref::share(found ? found : Py_None);
}

[[nodiscard]] double number_in(PyObject* dictionary, const char* key, double otherwise)
{
    const Ref value = item(dictionary, key);
    if (value.get() == Py_None) return otherwise;
    const double number = PyFloat_AsDouble(value.get());
    if (number == -1 && PyErr_Occurred()) throw PythonError();
    return number;
}

[[nodiscard]] bool truth_in(PyObject* dictionary, const char* key)
{
    const int truth = PyObject_IsTrue(item(dictionary, key).get());
    if (truth < 0) throw PythonError();
    return truth != 0;
}

[[nodiscard]] std::string text_in(PyObject* dictionary, const char* key)
{
    const Ref value = item(dictionary, key);
    if (value.get() == Py_None) return {};
    const char* text = PyUnicode_AsUTF8(value.get());
    if (!text) throw PythonError();
    return text;
}

/// One number that a callback has returned; true counts as 1, false as -1.
[[nodiscard]] double as_guard(PyObject* result, const std::string& who)
{
    if (PyFloat_Check(result)) return PyFloat_AS_DOUBLE(result);
    if (PyBool_Check(result)) return result == Py_True ? 1 : -1;
    if (PyArray_IsScalar(result, Bool)) return PyObject_IsTrue(result) ? 1 : -1;
    if (!PyComplex_Check(result) && result != Py_None) {
        const double number = PyFloat_AsDouble(result);
        if (number != -1 || !PyErr_Occurred()) return number;
        if (!PyErr_ExceptionMatches(PyExc_TypeError) && !PyErr_ExceptionMatches(PyExc_ValueError)) {
            throw PythonError();
        }
        PyErr_Clear();
    }
    raise(PyExc_TypeError, who + " returned " + type_of(result) + ", expected a number");
}

/// The numbers that a callback has returned, handed to `take(count, get)`.
class Numbers {
public:
    Numbers(PyObject* result, const char* who, const std::string& of)
        : result_(result), who_(who), of_(of)
    {
        if (PyList_CheckExact(result) || PyTuple_CheckExact(result)) {
            items_ = PySequence_Fast_ITEMS(result);
            size_ = static_cast<std::size_t>(PySequence_Fast_GET_SIZE(result));
            for (std::size_t i = 0; i < size_; ++i) {
                if (!PyFloat_Check(items_[i]) && !PyLong_Check(items_[i])) {
                    items_ = nullptr;  // let NumPy see whether these are numbers
                    break;
                }
            }
            if (items_) return;
        }
        read_array();
    }

    [[nodiscard]] std::size_t size() const noexcept { return size_; }

    /// out[i] = number i times factor(i).
    template <class Factor>
    void copy(double* out, const Factor& factor) const
    {
        for (std::size_t i = 0; i < size_; ++i) {
            double number = 0;
            if (!items_) {
                number = data_[i];
            } else if (PyFloat_Check(items_[i])) {
                number = PyFloat_AS_DOUBLE(items_[i]);
            } else {
                number = PyLong_AsDouble(items_[i]);
                if (number == -1 && PyErr_Occurred()) throw PythonError();
            }
            out[i] = number * factor(i);
        }
    }

private:
    [[noreturn]] void refuse(const std::string& found) const
    {
        raise(PyExc_TypeError,
              who_ + of_ + " returned " + found + ", expected a sequence of numbers");
    }

    void read_array()
    {
        if (result_ == Py_None) refuse("None");
        Ref array = Ref::take(PyArray_FromAny(result_, nullptr, 0, 0, 0, nullptr));
        if (!array) {
            const PythonError error;
            if (!PyErr_GivenExceptionMatches(error.value(), PyExc_ValueError) &&
                !PyErr_GivenExceptionMatches(error.value(), PyExc_TypeError)) {
                throw error;
            }
            refuse("a " + type_of(result_));
        }
        auto* given = reinterpret_cast<PyArrayObject*>(array.get());
        const int type = PyArray_TYPE(given);
        if (PyTypeNum_ISCOMPLEX(type)) refuse("complex numbers");
        if (PyTypeNum_ISFLEXIBLE(type) || PyTypeNum_ISDATETIME(type)) {
            refuse("a " + type_of(result_));
        }
        if (PyArray_NDIM(given) > 1) {
            raise(PyExc_ValueError, who_ + of_ + " returned an array of " +
                                        std::to_string(PyArray_NDIM(given)) +
                                        " dimensions, expected 1");
        }
        if (type == NPY_OBJECT) return read_objects(array);
        if (type != NPY_DOUBLE || !PyArray_ISCARRAY_RO(given)) {
            array = Ref::take(PyArray_FromAny(array.get(), PyArray_DescrFromType(NPY_DOUBLE), 0, 1,
                                              NPY_ARRAY_CARRAY_RO | NPY_ARRAY_FORCECAST, nullptr));
            if (!array) {
                PyErr_Clear();
                refuse("a " + type_of(result_));
            }
            given = reinterpret_cast<PyArrayObject*>(array.get());
        }
        data_ = static_cast<const double*>(PyArray_DATA(given));
        size_ = static_cast<std::size_t>(PyArray_SIZE(given));
        kept_ = std::move(array);
    }

    void read_objects(const Ref& array)
    {
        const Ref list = checked(PyArray_ToList(reinterpret_cast<PyArrayObject*>(array.get())));
        if (!PyList_Check(list.get())) refuse("a " + type_of(result_));
        for (Py_ssize_t i = 0; i < PyList_GET_SIZE(list.get()); ++i) {
            converted_.push_back(PyFloat_AsDouble(PyList_GET_ITEM(list.get(), i)));
            if (PyErr_Occurred()) {
                PyErr_Clear();
                refuse("a " + type_of(result_) + " with a " +
                       type_of(PyList_GET_ITEM(list.get(), i)));
            }
        }
        data_ = converted_.data();
        size_ = converted_.size();
    }

    PyObject* result_;
    std::string who_;
    const std::string& of_;
    std::vector<double> converted_;
    PyObject** items_ = nullptr;
    const double* data_ = nullptr;
    std::size_t size_ = 0;
    Ref kept_;
};

/// An array that callbacks are shown. Where one has kept it, the next is shown another, so that
/// what was kept does not change.
class ShownArray {
public:
    [[nodiscard]] PyObject* show(const State& x, const std::vector<double>& scale)
    {
        auto* array = reinterpret_cast<PyArrayObject*>(array_.get());
        const auto size = static_cast<npy_intp>(x.size());
        if (!array || Py_REFCNT(array) != 1 || PyArray_NDIM(array) != 1 ||
            PyArray_DIM(array, 0) != size || PyArray_TYPE(array) != NPY_DOUBLE ||
            !PyArray_ISCARRAY(array)) {
            npy_intp shape = size;
            array_ = checked(PyArray_SimpleNew(1, &shape, NPY_DOUBLE));
            array = reinterpret_cast<PyArrayObject*>(array_.get());
        }
        auto* to = static_cast<double*>(PyArray_DATA(array));
        std::memcpy(to, x.data(), x.size() * sizeof(double));
        for (std::size_t i = 0; i < std::min(scale.size(), x.size()); ++i) to[i] *= scale[i];
        return array_.get();
    }

private:
    Ref array_;
};

}  // namespace

Function::Function(PyObject* given)
{
    if (given == Py_None) return;
    if (PyObject_HasAttrString(given, "_ricochet_address")) {
        const Ref at = checked(PyObject_GetAttrString(given, "_ricochet_address"));
        const Ref with = checked(PyObject_GetAttrString(given, "_ricochet_user"));
        address = PyLong_AsVoidPtr(at.get());
        user = PyLong_AsVoidPtr(with.get());
        if (PyErr_Occurred()) throw PythonError();
        object = Ref::share(given);  // keeps what it was made from
        return;
    }
    if (!PyCallable_Check(given)) {
        raise(PyExc_TypeError, "found a " + type_of(given) + ", expected a function");
    }
    object = Ref::share(given);
}

/// The system at the door of one run, with what it shows to callbacks.
class CallbackDoor final : public RunDoor {
    using Table = detail::SystemTable<State>;

public:
    CallbackDoor(const CallbackSource& source, const Request& request)
        : source_(source), scale_(request.scale)
    {
        for (const double unit : scale_) inverse_.push_back(1 / unit);
    }

    [[nodiscard]] const Table& table() const noexcept override { return source_.table_; }
    [[nodiscard]] void* door() noexcept override { return this; }
    [[nodiscard]] bool is_free() const noexcept override { return source_.free_; }

    static void fill(Table& table, const CallbackSource& source)
    {
        const auto& guards = source.guards_;
        const auto any = [&](auto member) {
            return std::any_of(guards.begin(), guards.end(),
                               [&](const CallbackGuard& guard) { return bool(guard.*member); });
        };
        const auto every = [&](auto member) {
            return std::all_of(guards.begin(), guards.end(),
                               [&](const CallbackGuard& guard) { return bool(guard.*member); });
        };
        table.moded = source.moded_;
        table.flow = [](void* door, Mode mode, double t, const State& x, State& dxdt) {
            return at(door).flow(mode, t, x, dxdt);
        };
        table.mode_count = [](void* door) { return at(door).source_.mode_count_; };
        table.guard_count = [](void* door) { return at(door).source_.guards_.size(); };
        table.name = [](void* door) { return at(door).name(); };
        if (source.next_time_event_) {
            table.next_time_event = [](void* door, double t) {
                return at(door).time_event(at(door).source_.next_time_event_, t, infinity);
            };
            if (source.previous_time_event_) {
                table.previous_time_event = [](void* door, double t) {
                    return at(door).time_event(at(door).source_.previous_time_event_, t, -infinity);
                };
            }
            table.time_reset = [](void* door, Mode mode, double t, State& x) {
                return at(door).time_reset(mode, t, x);
            };
        }
        if (guards.empty()) return;
        table.guarded = true;
        table.guard_alone = !source.guard_values_;
        table.rated = every(&CallbackGuard::rate);
        table.calls_of_rate = table.rated ? 0 : 2;
        table.info = [](void* door, std::size_t which) {
            return at(door).source_.guards_[which].info;
        };
        table.guards = [](void* door, Mode mode, double t, const State& x, std::span<double> g) {
            at(door).guards(mode, t, x, g);
        };
        table.guard = [](void* door, std::size_t which, Mode mode, double t, const State& x) {
            return at(door).guard(which, mode, t, x);
        };
        table.rate = [](void* door, std::size_t which, Mode mode, bool backward, double t,
                        const State& x, const State& dxdt, double scale) {
            return at(door).rate(which, mode, backward, t, x, dxdt, scale);
        };
        if (table.rated) {
            table.each_rate = [](void* door, Mode mode, double t, const State& x, const State& dxdt,
                                 std::span<double> rates) {
                for (std::size_t i = 0; i < rates.size(); ++i) {
                    rates[i] =
                        at(door).is_in(i, mode) ? at(door).closed_rate(i, mode, t, x, dxdt) : 0;
                }
            };
        }
        if (std::any_of(guards.begin(), guards.end(),
                        [](const CallbackGuard& guard) { return !guard.in_mode.empty(); })) {
            table.enabled_in = [](void* door, std::size_t which, Mode mode) {
                return at(door).is_in(which, mode);
            };
        }
        if (any(&CallbackGuard::enabled)) {
            table.enabled_at = [](void* door, std::size_t which, Mode mode, double t,
                                  const State& x) { return at(door).enabled(which, mode, t, x); };
        }
        if (source.reset_set_) {
            table.reset_set = [](void* door, std::span<const std::size_t> fired, bool on_time,
                                 Mode mode, double t, State& x) {
                return at(door).reset_set(fired, on_time, mode, t, x);
            };
        } else if (any(&CallbackGuard::reset)) {
            table.reset = [](void* door, std::size_t which, Mode mode, double t, State& x) {
                const CallbackGuard& guard = at(door).source_.guards_[which];
                return at(door).edit(guard.reset, "reset of ", guard.name, mode, t, x);
            };
        }
        if (any(&CallbackGuard::rest)) {
            table.rest = [](void* door, std::size_t which, Mode mode, double t, State& x) {
                const CallbackGuard& guard = at(door).source_.guards_[which];
                return at(door).edit(guard.rest, "rest of ", guard.name, mode, t, x);
            };
        }
        if (every(&CallbackGuard::speed_bound)) fill_bounds(table, any);
    }

private:
    template <class Any>
    static void fill_bounds(Table& table, const Any& any)
    {
        table.bounded = true;
        table.lipschitz = [](void* door, std::size_t which) {
            return at(door).source_.guards_[which].lipschitz;
        };
        table.speed_bound = &bound<&CallbackGuard::speed_bound>;
        table.acceleration_bound = &bound<&CallbackGuard::acceleration_bound>;
        if (any(&CallbackGuard::lower_bound)) {
            table.lower_bound = &bound<&CallbackGuard::lower_bound>;
        }
        if (any(&CallbackGuard::upper_bound)) {
            table.upper_bound = &bound<&CallbackGuard::upper_bound>;
        }
    }

    [[nodiscard]] static CallbackDoor& at(void* door) noexcept
    {
        return *static_cast<CallbackDoor*>(door);
    }

    // --- states ---

    [[nodiscard]] double unit(std::size_t i) const noexcept
    {
        return i < scale_.size() ? scale_[i] : 1;
    }
    [[nodiscard]] double inverse(std::size_t i) const noexcept
    {
        return i < inverse_.size() ? inverse_[i] : 1;
    }

    /// For compiled functions.
    [[nodiscard]] const double* plain(const State& x, State& room) const
    {
        if (scale_.empty()) return x.data();
        room = x;
        for (std::size_t i = 0; i < std::min(scale_.size(), x.size()); ++i) room[i] *= scale_[i];
        return room.data();
    }

    // --- calls ---

    /// function([mode,] t, further..., arguments...)
    template <class... Further>
    [[nodiscard]] Ref call(const Function& function, Mode mode, double t,
                           const Further&... further) const
    {
        std::array<PyObject*, most_arguments> stack{};
        std::size_t count = 1;  // the first place belongs to the one that is called
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
        std::string out = source_.name_.empty() ? "Python" : source_.name_;
        for (const double unit : scale_) out += ' ' + std::to_string(std::ilogb(unit));
        return out;
    }

    bool flow(Mode mode, double t, const State& x, State& dxdt)
    {
        const Function& function = source_.flow_;
        if (dxdt.size() != x.size()) dxdt.resize(x.size());
        if (function.address) {
            watch_.tick();
            reinterpret_cast<CompiledFlow>(function.address)(mode, t, plain(x, room_), dxdt.data(),
                                                             x.size(), function.user);
            for (std::size_t i = 0; i < std::min(inverse_.size(), x.size()); ++i) {
                dxdt[i] *= inverse_[i];
            }
            return true;
        }
        const Ref result = call(function, mode, t, x_.show(x, scale_));
        const Numbers numbers(result.get(), "flow", nobody_);
        if (numbers.size() != x.size()) {
            raise(PyExc_ValueError, "flow returned " + std::to_string(numbers.size()) +
                                        " numbers for a state of " + std::to_string(x.size()));
        }
        numbers.copy(dxdt.data(), [&](std::size_t i) { return inverse(i); });
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
                // One that is not looked at in this mode may have no value there.
                g[i] = is_in(i, mode) ? guard(i, mode, t, x) : 1;
            }
            return;
        }
        const Ref result = call(source_.guard_values_, mode, t, x_.show(x, scale_));
        const Numbers numbers(result.get(), "guard_values", nobody_);
        if (numbers.size() != g.size()) {
            raise(PyExc_ValueError, "guard_values returned " + std::to_string(numbers.size()) +
                                        " numbers for " + std::to_string(g.size()) + " guards");
        }
        numbers.copy(g.data(), [](std::size_t) { return 1.0; });
    }

    [[nodiscard]] double guard(std::size_t which, Mode mode, double t, const State& x)
    {
        if (source_.guard_values_) {
            values_.resize(source_.guards_.size());
            guards(mode, t, x, values_);
            return values_[which];
        }
        const CallbackGuard& guard = source_.guards_[which];
        if (guard.value.address) {
            return reinterpret_cast<CompiledGuard>(guard.value.address)(mode, t, plain(x, room_),
                                                                        x.size(), guard.value.user);
        }
        return number(guard.value, "guard ", guard.name, mode, t, x);
    }

    [[nodiscard]] double number(const Function& function, const char* what, const std::string& of,
                                Mode mode, double t, const State& x)
    {
        const Ref result = call(function, mode, t, x_.show(x, scale_));
        if (PyFloat_Check(result.get())) return PyFloat_AS_DOUBLE(result.get());
        return as_guard(result.get(), what + of);
    }

    [[nodiscard]] double closed_rate(std::size_t which, Mode mode, double t, const State& x,
                                     const State& dxdt)
    {
        const CallbackGuard& guard = source_.guards_[which];
        if (guard.rate.address) {
            const double* state = plain(x, room_);
            return reinterpret_cast<CompiledRate>(guard.rate.address)(
                mode, t, state, plain(dxdt, rate_room_), x.size(), guard.rate.user);
        }
        const Ref result = call(guard.rate, mode, t, x_.show(x, scale_), dxdt_.show(dxdt, scale_));
        return as_guard(result.get(), "rate of " + guard.name);
    }

    /// In closed form, else the central difference along the flow; see `GuardView::rate`.
    [[nodiscard]] double rate(std::size_t which, Mode mode, bool backward, double t, const State& x,
                              const State& dxdt, double scale)
    {
        if (source_.guards_[which].rate) {
            if (!backward) return closed_rate(which, mode, t, x, dxdt);
            return -closed_rate(which, mode, t, x, detail::negated(dxdt));
        }
        const double delta = 1e-5 * scale;
        const auto moved = [&](double s) {
            there_ = x;
            for (std::size_t i = 0; i < x.size(); ++i) there_[i] = x[i] + s * dxdt[i];
            return guard(which, mode, backward ? t - s : t + s, there_);
        };
        const double after = moved(delta);
        return (after - moved(-delta)) / (2 * delta);
    }

    [[nodiscard]] bool enabled(std::size_t which, Mode mode, double t, const State& x)
    {
        const CallbackGuard& guard = source_.guards_[which];
        if (!guard.enabled) return true;
        const Ref result = call(guard.enabled, mode, t, x_.show(x, scale_));
        const int truth = PyObject_IsTrue(result.get());
        if (truth < 0) throw PythonError();
        return truth != 0;
    }

    template <Function CallbackGuard::*member>
    [[nodiscard]] static double bound(void* door, std::size_t which, Mode mode, double t,
                                      const State& x)
    {
        const CallbackGuard& guard = at(door).source_.guards_[which];
        const Function& function = guard.*member;
        if (!function) {
            return member == &CallbackGuard::acceleration_bound ? 0
                   : member == &CallbackGuard::lower_bound      ? -infinity
                                                                : infinity;
        }
        if (function.address) {
            return reinterpret_cast<CompiledGuard>(function.address)(
                mode, t, at(door).plain(x, at(door).room_), x.size(), function.user);
        }
        return at(door).number(function, "bound of ", guard.name, mode, t, x);
    }

    // --- resets ---

    /// x⁻ becomes x⁺; returns the mode after it.
    [[nodiscard]] Mode edit(const Function& function, const char* what, const std::string& of,
                            Mode mode, double t, State& x)
    {
        if (!function) return mode;
        if (function.address) {
            const auto reset = reinterpret_cast<CompiledReset>(function.address);
            for (std::size_t i = 0; i < x.size(); ++i) x[i] *= unit(i);
            const Mode next = reset(mode, t, x.data(), x.size(), function.user);
            for (std::size_t i = 0; i < x.size(); ++i) x[i] *= inverse(i);
            return source_.moded_ ? next : mode;
        }
        const Ref result = call(function, mode, t, x_.show(x, scale_));
        return take_place(result.get(), what, of, mode, x);
    }

    [[nodiscard]] Mode reset_set(std::span<const std::size_t> fired, bool on_time, Mode mode,
                                 double t, State& x)
    {
        const Ref list = checked(PyList_New(static_cast<Py_ssize_t>(fired.size() + on_time)));
        for (std::size_t i = 0; i < fired.size(); ++i) {
            PyList_SET_ITEM(list.get(), static_cast<Py_ssize_t>(i), PyLong_FromSize_t(fired[i]));
        }
        if (on_time) {
            PyList_SET_ITEM(list.get(), static_cast<Py_ssize_t>(fired.size()),
                            PyUnicode_FromString("time"));
        }
        const Ref result = call(source_.reset_set_, mode, t, x_.show(x, scale_), list.get());
        return take_place(result.get(), "reset_set", nobody_, mode, x);
    }

    [[nodiscard]] Mode time_reset(Mode mode, double t, State& x)
    {
        return edit(source_.time_reset_, "time_reset", nobody_, mode, t, x);
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
        if (PyTuple_Check(result)) {
            if (PyTuple_GET_SIZE(result) != 2) {
                raise(PyExc_ValueError, what + of + " returned a tuple of " +
                                            std::to_string(PyTuple_GET_SIZE(result)) +
                                            ", expected (mode, state)");
            }
            name = PyTuple_GET_ITEM(result, 0);
            take_state(PyTuple_GET_ITEM(result, 1), what, of, x);
        }
        PyObject* number = PyDict_GetItemWithError(source_.mode_numbers_.get(), name);
        if (!number) {
            PyErr_Clear();
            const Ref text = checked(PyObject_Repr(name));
            const Ref modes = checked(PyObject_Repr(source_.mode_list_.get()));
            raise(PyExc_ValueError, what + of + " returned " + PyUnicode_AsUTF8(text.get()) +
                                        ", expected a mode or (mode, state), the modes being " +
                                        PyUnicode_AsUTF8(modes.get()));
        }
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
        numbers.copy(x.data(), [&](std::size_t i) { return inverse(i); });
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
    std::vector<double> scale_, inverse_;
    ShownArray x_, dxdt_;
    State room_, rate_room_, there_;
    std::vector<double> values_;
    const std::string nobody_;
};

CallbackSource::CallbackSource(PyObject* specification)
{
    if (!has_numpy()) throw PythonError();
    if (!PyDict_Check(specification)) {
        raise(PyExc_TypeError, "found a " + type_of(specification) + ", expected a dictionary");
    }
    const auto function = [&](const char* key) { return Function(item(specification, key).get()); };
    name_ = text_in(specification, "name");
    flow_ = function("flow");
    if (!flow_) raise(PyExc_TypeError, "flow: found None, expected a function");
    guard_values_ = function("guard_values");
    reset_set_ = function("reset_set");
    next_time_event_ = function("next_time_event");
    previous_time_event_ = function("previous_time_event");
    time_reset_ = function("time_reset");

    const Ref arguments = item(specification, "args");
    if (arguments.get() != Py_None) {
        const Ref sequence =
            checked(PySequence_Fast(arguments.get(), "args: expected a tuple or a list"));
        const Py_ssize_t count = PySequence_Fast_GET_SIZE(sequence.get());
        if (count > static_cast<Py_ssize_t>(most_arguments) - 8) {
            raise(PyExc_ValueError,
                  "args: found " + std::to_string(count) + " arguments, expected at most 24");
        }
        for (Py_ssize_t i = 0; i < count; ++i) {
            arguments_.push_back(Ref::share(PySequence_Fast_GET_ITEM(sequence.get(), i)));
        }
    }

    mode_list_ = item(specification, "modes");
    moded_ = mode_list_.get() != Py_None;
    if (moded_) {
        mode_count_ = static_cast<std::size_t>(PyList_GET_SIZE(mode_list_.get()));
        mode_numbers_ = checked(PyDict_New());
        for (std::size_t i = 0; i < mode_count_; ++i) {
            const Ref number = checked(PyLong_FromSize_t(i));
            if (PyDict_SetItem(mode_numbers_.get(),
                               PyList_GET_ITEM(mode_list_.get(), static_cast<Py_ssize_t>(i)),
                               number.get()) != 0) {
                throw PythonError();
            }
        }
    } else {
        mode_list_ = Ref();
    }

    const Ref guards = item(specification, "guards");
    if (guards.get() != Py_None) {
        const auto count = static_cast<std::size_t>(PyList_GET_SIZE(guards.get()));
        guards_.reserve(count);  // names are referred to
        for (std::size_t i = 0; i < count; ++i) {
            read_guard(PyList_GET_ITEM(guards.get(), static_cast<Py_ssize_t>(i)));
        }
    }

    const auto is_free = [](const Function& f) { return !f || f.address; };
    free_ = is_free(flow_) && !guard_values_ && !reset_set_ && !next_time_event_ &&
            !previous_time_event_ && is_free(time_reset_);
    for (const CallbackGuard& guard : guards_) {
        free_ = free_ && is_free(guard.value) && is_free(guard.rate) && is_free(guard.reset) &&
                is_free(guard.rest) && !guard.enabled && is_free(guard.speed_bound) &&
                is_free(guard.acceleration_bound) && is_free(guard.lower_bound) &&
                is_free(guard.upper_bound);
    }
    table_.changes_dimension = truth_in(specification, "changes_dimension");
    CallbackDoor::fill(table_, *this);
}

void CallbackSource::read_guard(PyObject* specification)
{
    CallbackGuard& guard = guards_.emplace_back();
    const auto function = [&](const char* key) { return Function(item(specification, key).get()); };
    guard.name = text_in(specification, "name");
    guard.value = function("value");
    guard.rate = function("rate");
    guard.reset = function("reset");
    guard.rest = function("rest");
    guard.enabled = function("enabled");
    guard.speed_bound = function("speed_bound");
    guard.acceleration_bound = function("acceleration_bound");
    guard.lower_bound = function("lower_bound");
    guard.upper_bound = function("upper_bound");
    guard.lipschitz = number_in(specification, "lipschitz", 1);
    if (!guard.value && !guard_values_) {
        raise(PyExc_TypeError, "guard " + guard.name + ": found None, expected a function");
    }
    const double direction = number_in(specification, "direction", 0);
    guard.info = {
        .name = guard.name,
        .crossing = direction < 0   ? Crossing::falling
                    : direction > 0 ? Crossing::rising
                                    : Crossing::either,
        .resets = guard.reset || (reset_set_ && truth_in(specification, "resets")),
        .stop_after = static_cast<std::uint32_t>(number_in(specification, "stop_after", 0)),
        .unilateral = truth_in(specification, "unilateral"),
        .boolean = truth_in(specification, "boolean"),
        .degree = static_cast<int>(number_in(specification, "degree", 0)),
        .touch = number_in(specification, "touch", 0)};
    const Ref modes = item(specification, "in_modes");
    if (modes.get() == Py_None) return;
    guard.in_mode.assign(mode_count_, false);
    for (Py_ssize_t i = 0; i < PyList_GET_SIZE(modes.get()); ++i) {
        PyObject* number =
            PyDict_GetItemWithError(mode_numbers_.get(), PyList_GET_ITEM(modes.get(), i));
        if (!number) {
            PyErr_Clear();
            const Ref text = checked(PyObject_Repr(PyList_GET_ITEM(modes.get(), i)));
            raise(PyExc_ValueError, "guard " + guard.name + ": found the mode " +
                                        PyUnicode_AsUTF8(text.get()) +
                                        ", which the system does not have");
        }
        guard.in_mode[PyLong_AsSize_t(number)] = true;
    }
}

std::unique_ptr<RunDoor> CallbackSource::open(const State& /*x0*/, const Request& request) const
{
    return std::make_unique<CallbackDoor>(*this, request);
}

std::vector<std::string> CallbackSource::mode_names() const
{
    return {};  // the objects themselves are kept in Python
}

std::vector<std::string> CallbackSource::guard_names() const
{
    std::vector<std::string> names;
    for (const CallbackGuard& guard : guards_) names.push_back(guard.name);
    return names;
}

}  // namespace ricochet::python
