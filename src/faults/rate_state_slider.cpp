#include "ricochet/faults/spring_slider.hpp"

#include "base/require.hpp"

namespace ricochet {

RateStateSlider::RateStateSlider(const SpringSlider& slider, double threshold)
    : slider_(slider), level_(std::log(threshold / slider.friction.v_star))
{
    validate(slider.friction);
    validate(slider.block);
    detail::require_positive("RateStateSlider", "threshold", threshold);
    detail::require(slider.evolution == StateEvolution::ageing, "RateStateSlider", "evolution",
                    "be the ageing law", static_cast<double>(slider.evolution));
}

RateStateSlider::State RateStateSlider::start(const SliderState& at) const
{
    const RateStateParameters& p = slider_.friction;
    detail::require_positive("RateStateSlider", "V at the start", at.v);
    return {at.x / p.d_rs, std::log(at.v / p.v_star), at.xi};
}

}  // namespace ricochet
