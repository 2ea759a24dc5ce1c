#include "setup.hpp"

#include <memory>
#include <span>
#include <stdexcept>
#include <string>
#include <utility>

#include "core/detect/named_detectors.hpp"
#include "ricochet/detail/finders.hpp"
#include "ricochet/detail/kernels.hpp"
#include "ricochet/extremum.hpp"
#include "ricochet/locators.hpp"
#include "ricochet/planned.hpp"
#include "ricochet/rosenbrock.hpp"
#include "ricochet/taylor/taylor.hpp"

namespace ricochet::python {

namespace {

/// Placeholder for the system in the tables of detectors. These only use its bounds, which they get
/// through the table of the run.
struct SomeSystem {
    void flow(double /*t*/, const State& /*x*/, State& /*dxdt*/) const {}
    [[nodiscard]] double guard(double /*t*/, const State& /*x*/) const { return 1; }
    [[nodiscard]] double speed_bound(double /*t*/, const State& /*x*/) const { return 0; }
};

template <class Detector>
void detect_by(detail::RunBindings<State>& setup)
{
    static const Detector detector{};
    setup.detector = detail::DetectorTableOf<Detector, SomeSystem, State>::make(detector);
    setup.detecting = &detector;
}

template <class Locator>
void locate_by(detail::RunBindings<State>& setup)
{
    static const Locator locator{};
    setup.locator = detail::locator_table<Locator>();
    setup.locating = &locator;
}

[[noreturn]] void refuse(const char* option, std::string_view given, const std::string& expected)
{
    throw std::invalid_argument(std::string(option) + ": found '" + std::string(given) +
                                "', expected " + expected);
}

void detect_without_gate(detail::RunBindings<State>& setup, const Request& request)
{
    const std::string_view detector = request.detector;
    if (request.gate) {
        throw std::invalid_argument("gate: found one for the detector '" + std::string(detector) +
                                    "', which asks none");
    }
    if (detector == "planned") {
        detect_by<Planned<>>(setup);
    } else if (!detail::NamedDetectors::at(detail::detector_place(detector),
                                           [&]<class Detector>() { detect_by<Detector>(setup); })) {
        refuse("detector", detector, "one of those in the documentation");
    }
}

/// Refuses what no run with phases has. @param what  makes it one
void check_phases(const Request& request, const std::string& what, bool may_be_fixed)
{
    const bool named = !request.by_series && !request.implicit;
    const bool fits = named && (request.fixed ? may_be_fixed : estimates_error(request.method));
    if (!fits) {
        throw std::invalid_argument(
            what +
            (may_be_fixed ? ": found 'taylor' or 'rosenbrock4' beside it, expected "
                          : ": found fixed steps, 'taylor' or 'rosenbrock4' beside it, "
                            "expected ") +
            detail::spelled_methods(true, "'") + " with error control");
    }
    if (detail::detector_place(request.detector) == detail::NamedDetectors::size) {
        refuse("detector", request.detector, detail::spelled_detectors("'") + " beside " + what);
    }
}

}  // namespace

std::vector<double> RunLoop::reaction() const
{
    return contact_ ? contact_->forces() : loop_->reaction();
}

Record RunLoop::record(Run<State>&& run, RunAdapter& adapter, const StepEnds<State>* steps) const
{
    if (!contact_) return with_counts(record_of(std::move(run), steps), adapter);
    run.phases = contact_->phases();
    run.reaction = contact_->forces();
    const ContactCounts counts = contact_->counts(run);
    Record out = with_counts(record_of(std::move(run), steps), adapter);
    out.contact = counts;
    return out;
}

RunLoop::RunLoop(const Request& request, const OwnedSetup& setup, RunAdapter& adapter,
                 const State& x0)
{
    if (adapter.has_contacts()) {
        check_phases(request, "a mechanism", true);
        contact_ = adapter.open_contacts(request, setup.setup, x0);
        loop_ = &contact_->loop();
        return;
    }
    if (request.events_only) {
        throw std::invalid_argument(
            "events_only: found one for a system without contacts, "
            "expected a ricochet.Mechanism");
    }
    if (!adapter.has_inclusion()) {
        own_ = detail::make_loop(setup.setup, x0, request.options);
        loop_ = own_.operator->();
        return;
    }
#ifdef RICOCHET_WITH_NONSMOOTH
    check_phases(request, "set_valued", false);
    detail::PhasedSetup<State> phases;
    phases.user = setup.setup;
    phases.method = request.method;
    adapter.add_inclusions(phases, x0.size(), request.options);
    phased_ = detail::make_phased_run(std::move(phases), x0, request.options);
    loop_ = &phased_->loop();
#else
    throw std::invalid_argument(
        "set_valued: found one, and a module that was built without set-valued motion, expected "
        "RICOCHET_NONSMOOTH=ON");
#endif
}

OwnedSetup setup_for(const Request& request, const Source& source, RunAdapter& adapter)
{
    OwnedSetup out;
    detail::RunBindings<State>& setup = out.setup;
    setup.system = &adapter.table();
    setup.adapter = adapter.adapter();
    setup.error_controlled = !request.fixed;
    setup.cancels_by_itself = true;
    if (!detect_by_gate(out, request, source, adapter)) detect_without_gate(setup, request);
    if (request.by_series) {
        adapter.choose_method(setup);
        setup.stepping = request.fixed ? detail::written_type<FixedStep<Taylor>>()
                                       : detail::written_type<ErrorControlled<Taylor>>();
    } else if (request.implicit) {
        adapter.choose_method(setup);
        setup.stepping = request.fixed ? detail::written_type<FixedStep<Rosenbrock4>>()
                                       : detail::written_type<ErrorControlled<Rosenbrock4>>();
    } else {
        setup.kernel = &detail::kernel_by_name<State>(request.method, 0);
        setup.method_by_name = true;
        setup.stepping = request.fixed ? detail::written_type<FixedStep<MethodByName>>()
                                       : detail::written_type<ErrorControlled<MethodByName>>();
    }
    const std::string_view locator = request.locator;
    if (locator == "newton") {
        locate_by<Newton>(setup);
    } else if (locator == "bisection") {
        locate_by<Bisection>(setup);
    } else if (locator == "toms748") {
        locate_by<Toms748>(setup);
    } else {
        refuse("locator", locator, "'newton', 'bisection' or 'toms748'");
    }
    return out;
}

}  // namespace ricochet::python
