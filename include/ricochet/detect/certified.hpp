// The certified gate: what a network clears has been proved.
//
// A certificate (nn/certificate.hpp) says that where the network clears, the first guard is above
// a margin. With the system's own bounds that is as good as a value: `Planned` closes intervals
// with it, and no exact look is needed where that is enough. Such steps are `proved`, and the
// events are those of the exact detector, bit for bit. Outside the box of the certificate, in a
// box that it lists as unproved, in modes other than 0 and for other guards the exact guard is
// asked. A system without bounds has every step checked: a state that is clear says nothing of the
// next one.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <memory>
#include <string_view>
#include <utility>

#include "ricochet/detail/gate.hpp"
#include "ricochet/detect/planned.hpp"
#include "ricochet/nn/certificate.hpp"

namespace ricochet {

/// Uses the levels of a gate that a certificate proves as lower bounds of the guard in the planner:
/// the events are those of `Exact`, bit for bit.
template <class Exact = Extremum>
class Certified : public Planned<Exact> {
public:
    static constexpr bool keeps_events = true;

    /// @throws std::invalid_argument if the model has no certificate or one that is void, names no
    /// known recipe of features, or has too many of them; or as `Planned`.
    explicit Certified(Model model, const PlannerOptions& options = {}, const Exact& exact = {})
        : Planned<Exact>(options, exact),
          certified_(std::make_shared<const CertifiedClassifier>(std::move(model))),
          recipe_(gate_recipe(this->model().recipe))
    {
        detail::check_certified(this->model());
    }

    [[nodiscard]] const Model& model() const noexcept { return certified_->classifier().model(); }
    [[nodiscard]] const Certificate& certificate() const noexcept
    {
        return certified_->certificate();
    }

    /// Whether the certificate speaks of this system: its name, where it has one, and the
    /// parameters that the model depends on, where it declares them. Steps may be of any length.
    /// @throws std::invalid_argument naming what the model is for and what it would have to be.
    template <class System, class X>
    void check(const System& system, const X& x, double /*smallest*/, double /*largest*/) const
    {
        detail::check_gate_model(model(), system);
        detail::check_gate_layout(model(), recipe_, feature_count(recipe_, system, x),
                                  mode_count_of(system));
    }

    /// The least that it ever clears.
    [[nodiscard]] double lowest_level() const noexcept
    {
        return certificate().levels.front().margin;
    }

    /// A value that the guard is proved to be above; 0: none.
    template <class System, class X>
    [[nodiscard]] gates::Gate::Answer level(const System& system, std::size_t which, Mode mode,
                                            double t, const X& x) const
    {
        if (which != 0 || mode != 0) return {};
        std::array<double, GateRecipe::most> features;
        gate_features(recipe_, system, mode, t, x, features.data());
        if (!certified_->classifier().in_domain(features.data())) return {.outside = true};
        return {.cleared = std::max(certified_->lower_bound(features.data()), 0.0)};
    }

private:
    std::shared_ptr<const CertifiedClassifier> certified_;
    GateRecipe recipe_;
};

}  // namespace ricochet
