#include "ricochet/systems/stick_slip.hpp"

#include "ricochet/systems/descriptor.hpp"
#include "spring_mass.hpp"

namespace ricochet {

const SystemDescriptor& StickSlip::descriptor()
{
    static const SystemDescriptor all{
        .name = name,
        .type = "StickSlip",
        .description = "A mass held by a spring sticks to a moving belt and slips, in turn.",
        .source =
            "R. I. Leine, D. H. van Campen, A. de Kraker and L. van den Steen, Stick-slip "
            "vibrations induced by alternate friction models, Nonlinear Dynamics 16, 1998, "
            "pages 41 to 54",
        .equations = {"slipping: mass u'' = -stiffness u - F(s) sign(v - belt-speed),",
                      "    F(s) = friction / (1 + weakening s),  s = |v - belt-speed|",
                      "sticking: u' = belt-speed while stiffness |u| <= friction"},
        .parameters = {detail::mass_of_oscillator(Parameters{}.mass),
                       detail::stiffness_of_spring(Parameters{}.stiffness),
                       {.name = "belt-speed",
                        .initial = Parameters{}.belt_speed,
                        .unit = "m/s",
                        .range = {},
                        .meaning = "to the right"},
                       {.name = "friction",
                        .initial = Parameters{}.friction,
                        .unit = "N",
                        .range = {.lower = 0, .lower_included = true},
                        .meaning = "at sliding speed 0, and of sticking"},
                       {.name = "weakening",
                        .initial = Parameters{}.weakening,
                        .unit = "s/m",
                        .range = {.lower = 0, .lower_included = true},
                        .meaning = "of friction with the sliding speed"}},
        .state = detail::position_and_velocity(start),
        .events = {"stick", "slip left", "slip right"},
        .t_end = 40,
        .comparison_step = 0.01,
        .constants = {{"period", period}}};
    return all;
}

}  // namespace ricochet
