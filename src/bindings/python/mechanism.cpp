#include "mechanism.hpp"

#include <pybind11/stl.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <span>
#include <stdexcept>
#include <string_view>
#include <type_traits>
#include <utility>

#include "mechanism_flights.hpp"
#include "numbers.hpp"
#include "ricochet/detail/system_adapter.hpp"
#include "ricochet/nonsmooth/detail/contact_run.hpp"
#include "ricochet/nonsmooth/time_stepping.hpp"

namespace ricochet::python {

namespace {

[[nodiscard]] pybind11::object item(PyObject* specification, const char* key)
{
    return pybind11::reinterpret_borrow<pybind11::dict>(specification)[key];
}

/// The functions of a mechanism of n coordinates, called with arrays.
class Calls final : public MechanismCalls {
public:
    Calls(const MechanismDescription& of, std::size_t n) : of_(of), n_(n) {}

    [[nodiscard]] std::size_t contacts() const noexcept override { return of_.contacts; }
    [[nodiscard]] std::size_t components_of_each() const noexcept override
    {
        return 1 + of_.tangents;
    }
    [[nodiscard]] bool surfaces_move() const noexcept override { return bool(of_.surface_rates); }
    [[nodiscard]] double restitution(std::size_t contact) const override
    {
        return of_.restitution[contact];
    }
    [[nodiscard]] double friction(std::size_t contact) const override
    {
        return of_.friction[contact];
    }
    [[nodiscard]] double dry_friction(std::size_t coordinate) const override
    {
        return of_.dry_friction.empty() ? 0 : of_.dry_friction[coordinate];
    }

    void mass(const double* q, double* rows) override
    {
        if (!of_.mass) {
            std::ranges::copy(of_.constant_mass, rows);
            return;
        }
        const Ref result = call(of_.mass, {show(q_, q)});
        read_matrix(result.get(), "mass", {n_, n_}, rows);
    }
    void force(Mode mode, double t, const double* q, const double* v, double* f) override
    {
        const Ref time = checked(PyFloat_FromDouble(t));
        PyObject* const position = show(q_, q);
        PyObject* const velocity = show(v_, v);
        Ref result;
        if (of_.modes) {
            PyObject* const shown = PyList_GetItem(of_.modes.get(), mode);  // borrowed
            if (!shown) throw PythonError();
            result = call(of_.force, {shown, time.get(), position, velocity});
        } else {
            result = call(of_.force, {time.get(), position, velocity});
        }
        read(result.get(), "force", n_, f);
    }
    void gaps(double t, const double* q, double* g) override
    {
        if (of_.contacts == 0) return;
        const Ref result = call_at(of_.gaps, of_.timed_gaps, t, q);
        read(result.get(), "gaps", of_.contacts, g);
    }
    void directions(double t, const double* q, double* rows) override
    {
        if (of_.contacts == 0) return;
        const Ref result = call_at(of_.directions, of_.timed_directions, t, q);
        read_matrix(result.get(), "directions", {components(), n_}, rows);
    }
    void surface_rates(double t, const double* q, double* b) override
    {
        const Ref result = call_at(of_.surface_rates, true, t, q);
        read(result.get(), "surface_rates", components(), b);
    }

private:
    [[nodiscard]] static Ref call(const Function& function,
                                  std::initializer_list<PyObject*> arguments)
    {
        return checked(PyObject_Vectorcall(function.object.get(), arguments.begin(),
                                           arguments.size(), nullptr));
    }
    [[nodiscard]] Ref call_at(const Function& function, bool timed, double t, const double* q)
    {
        if (!timed) return call(function, {show(q_, q)});
        const Ref time = checked(PyFloat_FromDouble(t));
        return call(function, {time.get(), show(q_, q)});
    }
    [[nodiscard]] PyObject* show(ShownArray& array, const double* x)
    {
        shown_.assign(x, x + n_);
        return array.show(shown_);
    }
    static void read(PyObject* result, const std::string& what, std::size_t count, double* out)
    {
        const Numbers numbers(result, "", what);
        if (numbers.size() != count) {
            raise(PyExc_ValueError, what + " returned " + std::to_string(numbers.size()) +
                                        " numbers, expected " + std::to_string(count));
        }
        numbers.copy(out);
    }

    const MechanismDescription& of_;
    std::size_t n_;
    ShownArray q_, v_;
    State shown_;
};

[[nodiscard]] std::unique_ptr<MechanismFlight> flight_of_size(MechanismCalls& calls, std::size_t n)
{
    std::unique_ptr<MechanismFlight> out;
    const auto make = [&]<std::size_t... i>(std::index_sequence<i...>)
    {
        static_cast<void>(
            ((n == i + 1 && (out = make_flight<static_cast<int>(i + 1)>(calls))) || ...));
    };
    make(std::make_index_sequence<most_coordinates>());
    return out;
}

/// The flight with the guards, resets and time events that are declared beside it, as
/// `detail::FreeFlight` has them.
class PlainFlight {
public:
    static constexpr bool unchecked_names = true;
    static constexpr bool forward_only = true;
    using State = python::State;

    PlainFlight(const MechanismFlight& of, std::size_t contacts, RunAdapter& beside)
        : name(beside.table().name(beside.adapter())),
          of_(&of),
          beside_(&beside),
          contacts_(contacts),
          own_guards_(table().guarded ? table().guard_count(at()) : 0)
    {
    }

    std::string name;

    [[nodiscard]] RunAdapter& callbacks() const noexcept { return *beside_; }
    [[nodiscard]] std::size_t contacts() const noexcept { return contacts_; }
    [[nodiscard]] std::size_t own_mode_count() const
    {
        return table().moded ? table().mode_count(at()) : 1;
    }
    [[nodiscard]] std::size_t mode_count() const
    {
        return static_cast<std::size_t>(of_->kinds().count()) * detail::own_modes;
    }
    void flow(Mode mode, double t, const State& x, State& dxdt) const
    {
        of_->accelerate(mode, t, x, dxdt);
    }

    [[nodiscard]] std::size_t event_guards() const noexcept { return contacts_ + own_guards_; }
    [[nodiscard]] std::size_t guard_count() const noexcept
    {
        return event_guards() + of_->kinds().dry();
    }
    [[nodiscard]] GuardInfo guard_info(std::size_t which) const
    {
        if (which < contacts_) return {.name = "gap", .unilateral = true};
        if (which >= event_guards()) return {.name = "velocity under dry friction"};
        return table().info(at(), which - contacts_);
    }
    [[nodiscard]] bool enabled(std::size_t which, Mode mode) const
    {
        if (!is_own(which)) return !is_asleep(which, mode);
        return !table().enabled_in ||
               table().enabled_in(at(), which - contacts_, detail::own_mode(mode));
    }
    [[nodiscard]] bool enabled(std::size_t which, Mode mode, double t, const State& x) const
    {
        if (!is_own(which)) return true;
        return table().enabled_at(at(), which - contacts_, detail::own_mode(mode), t, x);
    }
    [[nodiscard]] double guard(std::size_t which, Mode mode, double t, const State& x) const
    {
        if (is_asleep(which, mode)) return 1;
        if (which < contacts_) return of_->gap(which, t, x);
        if (which >= event_guards()) return speed(which, mode, x);
        const Mode own = detail::own_mode(mode);
        if (table().enabled_in && !table().enabled_in(at(), which - contacts_, own)) return 1;
        return table().guard(at(), which - contacts_, own, t, x);
    }
    [[nodiscard]] Mode reset(const FiredGuards& fired, Mode mode, double t, State& x) const
    {
        const std::span<const std::size_t> all = fired.guards();
        std::size_t closed = 0;
        while (closed < all.size() && all[closed] < contacts_) ++closed;
        if (closed > 0) of_->collide(all.first(closed), t, x);
        const Mode own = detail::own_mode(mode);
        return reached(mode, own_resets(all.subspan(closed), fired.time_event(), own, t, x));
    }

    // --- time events ---

    [[nodiscard]] double next_time_event(double t) const
    {
        return table().next_time_event(at(), t);
    }
    [[nodiscard]] double timer(Mode mode, double t, const State& x) const
    {
        return table().next_time_event_at(at(), detail::own_mode(mode), t, x);
    }
    [[nodiscard]] std::size_t time_event_count(double t) const
    {
        return table().time_event_count(at(), t);
    }
    [[nodiscard]] Mode time_reset(Mode mode, double t, State& x) const
    {
        return reached(mode, table().time_reset(at(), detail::own_mode(mode), t, x));
    }

protected:
    [[nodiscard]] const detail::SystemTable<State>& table() const noexcept
    {
        return beside_->table();
    }
    [[nodiscard]] void* at() const noexcept { return beside_->adapter(); }
    [[nodiscard]] const MechanismFlight& of() const noexcept { return *of_; }
    [[nodiscard]] bool is_own(std::size_t which) const noexcept
    {
        return which >= contacts_ && which < event_guards();
    }
    /// Whether a guard of flights is not watched in a mode.
    [[nodiscard]] bool is_asleep(std::size_t which, Mode mode) const noexcept
    {
        return !is_own(which) && !of_->kinds().is_flight(mode);
    }
    /// The size of a velocity, or of its rate, in the direction in which the coordinate moves.
    [[nodiscard]] double speed(std::size_t which, Mode mode, const State& x) const
    {
        const std::size_t k = which - event_guards();
        const double v = x[of_->dry()[k]];
        return detail::FlightKinds::is_backward(k, mode) ? -v : v;
    }

private:
    /// The mode after a reset, or one that no system has.
    [[nodiscard]] Mode reached(Mode before, Mode own) const
    {
        if (own >= own_mode_count()) return static_cast<Mode>(-1);
        return detail::kind_of_phase(before) * detail::own_modes + own;
    }
    [[nodiscard]] Mode own_resets(std::span<const std::size_t> fired, bool time_event, Mode mode,
                                  double t, State& x) const
    {
        std::vector<std::size_t> own;
        for (const std::size_t i : fired) {
            if (is_own(i) && guard_info(i).resets) own.push_back(i - contacts_);
        }
        if (table().reset_set && !own.empty()) {
            return table().reset_set(at(), FiredGuards(own, time_event), mode, t, x);
        }
        if (table().reset) {
            for (const std::size_t i : own) mode = table().reset(at(), i, mode, t, x);
        }
        if (table().time_reset && time_event) return table().time_reset(at(), mode, t, x);
        return mode;
    }

    const MechanismFlight* of_;
    RunAdapter* beside_;
    std::size_t contacts_;
    std::size_t own_guards_;
};

/// The same where every guard of the system has a rate.
class RatedFlight : public PlainFlight {
public:
    using PlainFlight::PlainFlight;

    [[nodiscard]] double guard_rate(std::size_t which, Mode mode, double t, const State& x,
                                    const State& dxdt) const
    {
        if (is_asleep(which, mode)) return 0;
        if (which < contacts()) return of().gap_rate(which, t, x);
        if (which >= event_guards()) return speed(which, mode, dxdt);
        return table().rate(at(), {.which = which - contacts(), .mode = detail::own_mode(mode)},
                            {t, 1}, x, dxdt);
    }
};

/// The table of a flight without what the system beside it does not have.
template <class Flight>
[[nodiscard]] detail::SystemTable<State> table_of(const detail::SystemTable<State>& beside)
{
    using Adapter = detail::SystemAdapter<Flight, State>;
    auto table = detail::system_table<Flight, State>;
    if (!beside.enabled_at) table.enabled_at = nullptr;
    if (!beside.time_reset) table.time_reset = nullptr;
    if (!beside.next_time_event) table.next_time_event = nullptr;
    if (beside.next_time_event_at) {
        table.next_time_event_at = [](void* adapter, Mode mode, double t, const State& x) {
            return static_cast<Adapter*>(adapter)->system().timer(mode, t, x);
        };
    }
    if (beside.time_event_count) {
        table.time_event_count = [](void* adapter, double t) {
            return static_cast<Adapter*>(adapter)->system().time_event_count(t);
        };
    }
    return table;
}

/// A run of a mechanism.
class ContactRun final : public ContactLoop {
public:
    explicit ContactRun(detail::Owner<detail::ContactRunner<State>> run) : run_(std::move(run)) {}

    [[nodiscard]] detail::AnyLoop<State>& loop() noexcept override { return run_->loop(); }
    [[nodiscard]] std::vector<double> forces() const override
    {
        const ContactForces forces = run_->forces();
        std::vector<double> out(forces.contacts.begin(), forces.contacts.end());
        out.insert(out.end(), forces.coordinates.begin(), forces.coordinates.end());
        return out;
    }
    [[nodiscard]] const std::vector<MotionPhase>& phases() const noexcept override
    {
        return run_->phases();
    }
    [[nodiscard]] ContactCounts counts(const Run<State>& run) const override
    {
        const ContactStatistics of = run_->statistics(run.statistics, run.t);
        ContactCounts out{.steps = of.time_stepping.steps,
                          .problems = of.time_stepping.problems,
                          .iterations = of.time_stepping.iterations,
                          .sweeps = of.time_stepping.sweeps,
                          .unsolved = of.time_stepping.unsolved,
                          .to_contact = of.to_contact,
                          .to_flight = of.to_flight,
                          .time = of.contact_time};
        const bool failed =
            run.outcome == Outcome::not_converged || run.outcome == Outcome::non_finite;
        if (failed && phases().back().set_valued) {
            out.failed = true;
            out.contact = run_->failure().contact;
            out.residual = run_->failure().residual;
        }
        return out;
    }

private:
    detail::Owner<detail::ContactRunner<State>> run_;
};

template <class Flight>
class MechanismAdapter final : public RunAdapter {
public:
    MechanismAdapter(const MechanismDescription& of, std::unique_ptr<RunAdapter> beside,
                     const State& x0)
        : beside_(std::move(beside)),
          calls_(of, x0.size() / 2),
          any_(flight_of_size(calls_, x0.size() / 2)),
          flight_(*any_, of.contacts, *beside_),
          adapter_(flight_, x0),
          table_(table_of<Flight>(beside_->table()))
    {
    }

    [[nodiscard]] const detail::SystemTable<State>& table() const noexcept override
    {
        return table_;
    }
    [[nodiscard]] void* adapter() noexcept override { return &adapter_; }
    [[nodiscard]] bool is_free() const noexcept override { return false; }
    [[nodiscard]] SignalWatch& watch() noexcept override { return beside_->watch(); }
    [[nodiscard]] bool has_contacts() const noexcept override { return true; }
    [[nodiscard]] std::unique_ptr<ContactLoop> open_contacts(
        const Request& request, const detail::RunBindings<State>& flight, const State& x0) override
    {
        any_->check_start(request.options.t_start, x0);
        detail::ContactSetup<State> setup;
        setup.flight = flight;
        setup.steps = any_->steps();
        setup.phases = {.step = request.options.step, .events_only = request.events_only};
        setup.kinds = any_->kinds();
        setup.dry = any_->dry();
        setup.contacts = flight_.contacts();
        setup.event_guards = flight_.event_guards();
        setup.modes = flight_.own_mode_count();
        setup.keeps_rounding = x0.size() <= detail::SmallState::room;  // for the bits of C++
        Options options = request.options;
        // With error control it is not the length of the first step of a flight.
        if (!request.fixed) options.step = 0;
        return std::make_unique<ContactRun>(
            detail::make_contact_run(std::move(setup), x0, options));
    }

private:
    std::unique_ptr<RunAdapter> beside_;
    Calls calls_;
    std::unique_ptr<MechanismFlight> any_;
    Flight flight_;
    detail::SystemAdapter<Flight, State> adapter_;
    detail::SystemTable<State> table_;
};

}  // namespace

MechanismDescription::MechanismDescription(PyObject* specification)
{
    const auto function = [&](const char* key) {
        return Function(item(specification, key).ptr(), key);
    };
    const auto numbers = [&](const char* key) {
        return item(specification, key).cast<std::vector<double>>();
    };
    mass = function("mass");
    force = function("force");
    gaps = function("gaps");
    directions = function("directions");
    surface_rates = function("surface_rates");
    constant_mass = numbers("constant_mass");
    restitution = numbers("restitution");
    friction = numbers("friction");
    dry_friction = numbers("dry_friction");
    const pybind11::object list = item(specification, "modes");
    if (!list.is_none()) modes = Ref::share(list.ptr());
    contacts = item(specification, "contacts").cast<std::size_t>();
    tangents = item(specification, "tangents").cast<std::size_t>();
    timed_gaps = item(specification, "timed_gaps").cast<bool>();
    timed_directions = item(specification, "timed_directions").cast<bool>();
}

MechanismSource::MechanismSource(std::shared_ptr<const Source> beside, PyObject* specification)
    : beside_(std::move(beside)), description_(specification)
{
}

std::unique_ptr<RunAdapter> MechanismSource::open(const State& x0) const
{
    const std::size_t n = x0.size() / 2;
    if (n == 0 || x0.size() != 2 * n || n > most_coordinates) {
        throw std::invalid_argument("x0: found " + std::to_string(x0.size()) +
                                    " numbers, expected coordinates and velocities of a mechanism "
                                    "of 1 to " +
                                    std::to_string(most_coordinates) + " coordinates");
    }
    const auto require = [&](const char* what, std::size_t found, std::size_t expected) {
        if (found == 0 || found == expected) return;
        throw std::invalid_argument(std::string(what) + ": found " + std::to_string(found) +
                                    " numbers, expected " + std::to_string(expected) + " for " +
                                    std::to_string(n) + " coordinates");
    };
    require("mass", description_.constant_mass.size(), n * n);
    require("dry_friction", description_.dry_friction.size(), n);
    std::unique_ptr<RunAdapter> beside = beside_->open(x0);
    const auto& table = beside->table();
    if (!table.guarded || table.rated) {
        return std::make_unique<MechanismAdapter<RatedFlight>>(description_, std::move(beside), x0);
    }
    return std::make_unique<MechanismAdapter<PlainFlight>>(description_, std::move(beside), x0);
}

std::vector<std::string> MechanismSource::guard_names() const
{
    std::vector<std::string> names;
    for (std::size_t c = 0; c < description_.contacts; ++c) {
        names.push_back("contact " + std::to_string(c));
    }
    for (const std::string& own : beside_->guard_names()) names.push_back(own);
    return names;
}

}  // namespace ricochet::python
