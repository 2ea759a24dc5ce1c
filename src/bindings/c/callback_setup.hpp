// A system of callbacks with its detector and locator, in the engine's terms.
#pragma once

#include <memory>
#include <utility>
#include <vector>

#include "bindings/c/callback_table.hpp"
#include "bindings/c/options.hpp"
#include "ricochet/detail/core.hpp"
#include "ricochet/detail/finders.hpp"
#include "ricochet/gates.hpp"
#include "ricochet/locators.hpp"
#include "ricochet/nn/model.hpp"
#include "ricochet/planned.hpp"

namespace ricochet::c {

template <class X>
class CallbackSetup {
public:
    /// @throws std::invalid_argument or std::runtime_error for a model that is no gate.
    CallbackSetup(std::shared_ptr<const CallbackSystem> system, const X& like,
                  const FinderOptions& finders)
        : system_(std::move(system)),
          adapter_(*system_, like),
          table_(CallbackTable<X>::make(*system_))
    {
        setup_.system = &table_;
        setup_.adapter = static_cast<detail::SystemAdapter<CallbackSystem, X>*>(&adapter_);
        set_detector(finders);
        set_locator(finders.locator);
    }
    CallbackSetup(const CallbackSetup&) = delete;
    CallbackSetup& operator=(const CallbackSetup&) = delete;

    /// Without a method. Refers to this object.
    [[nodiscard]] const detail::RunBindings<X>& setup() const noexcept { return setup_; }

private:
    template <class Detector>
    void set_detector(const Detector& detector);
    void set_detector(const FinderOptions& finders);

    template <class Locator>
    void set_locator()
    {
        static const Locator locator;
        setup_.locator = detail::locator_table<Locator>();
        setup_.locating = &locator;
    }
    void set_locator(rc_locator locator)
    {
        switch (locator) {
            case RC_NEWTON: return set_locator<Newton>();
            case RC_BISECTION: return set_locator<Bisection>();
            case RC_TOMS748: return set_locator<Toms748>();
        }
    }

    std::shared_ptr<const CallbackSystem> system_;
    CallbackAdapter<X> adapter_;
    detail::SystemTable<X> table_;
    std::shared_ptr<const void> detector_;
    detail::RunBindings<X> setup_;
};

template <class X>
template <class Detector>
void CallbackSetup<X>::set_detector(const Detector& detector)
{
    const auto kept = std::make_shared<const Detector>(detector);
    setup_.detector = detail::DetectorTableOf<Detector, CallbackSystem, X>::make(*kept);
    setup_.detecting = kept.get();
    detector_ = kept;
}

template <class X>
void CallbackSetup<X>::set_detector(const FinderOptions& finders)
{
    const auto gate = [&] { return gates::Gate(load_model(finders.gate)); };
    const bool is_named = detail::NamedDetectors::at(
        place_of_detector(finders.detector), [&]<class Detector>() { set_detector(Detector()); });
    if (is_named) return;
    switch (finders.detector) {
        case RC_PLANNED: return set_detector(Planned<>());
        case RC_CALIBRATED: return set_detector(Calibrated<>(gate()));
        case RC_CALIBRATED_BOUNDS: return set_detector(CalibratedBounds<>(gate()));
        case RC_FORESEEN: return set_detector(Foreseen<>(gate()));
        default: return;
    }
}

// Instantiated where runs with these states are compiled.
extern template class CallbackSetup<std::vector<double>>;

}  // namespace ricochet::c
