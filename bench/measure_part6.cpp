// What the strike-slip fault and the trainers must show.
#include "measure_fault.hpp"
#include "measure_trainers.hpp"

namespace ricochet::bench {

std::vector<Check> checks_of_part_6()
{
    return {
        {.part = 6,
         .id = "fault-1",
         .sentence = "fault of one element",
         .target = "227.99875 mm within 1e-4, arrest 12.683187 s, peak 0.0684778 m/s at 10.43650 s",
         .run = rupture_one_element},
        {.part = 6,
         .id = "fault-published",
         .sentence = "published 10 x 10 kernels, 3 and 5 km",
         .target = "237.044 within 0.005, 825.203 within 0.01 mm",
         .run = rupture_published_kernels},
        {.part = 6,
         .id = "fault-published-scheme",
         .sentence = "published scheme on the 3 km kernel, steps 0.5 and 0.1 s, and controlled",
         .target = "243.671 and 238.089, 237.72 within 0.1 mm",
         .run = repeat_published_scheme},
        {.part = 6,
         .id = "fault-order",
         .sentence = "averaged Bathe, step halved from 0.5 to 0.03125 s, through all arrests",
         .target = "errors fall by 4: 3.5 to 4.6",
         .run = observe_order_through_arrests},
        {.part = 6,
         .id = "fault-100",
         .sentence = "100 x 100 elements, 30 s",
         .target = "249.773 mm within 0.05, 0.02 % of a quarter of the step, <= 8 s (FFTW: 2 s), "
                   "<= 64 MiB",
         .run = rupture_100},
        {.part = 6,
         .id = "fault-200",
         .sentence = "200 x 200 elements, 30 s",
         .target = "250.01 mm within 0.05, <= 60 s, <= 128 MiB",
         .run = rupture_200},
        {.part = 6,
         .id = "fault-bathe-100",
         .sentence = "averaged Bathe on 100 x 100 elements, steps of 0.125 s",
         .target = "<= 0.03 %, <= 30 s",
         .run = bathe_100},
        {.part = 6,
         .id = "fault-meshes",
         .sentence = "cost and mesh error from 10 x 10 to 400 x 400",
         .target = "shown",
         .run = table_of_meshes},
        {.part = 6,
         .id = "tqc-time",
         .sentence = "20 000 steps of TQC with the networks of the source, 9 observations, 1 action",
         .target = "<= 90 s on two cores",
         .run = time_of_tqc},
        {.part = 6,
         .id = "trainers-optimum",
         .sentence = "cost of a learned regulator over that of the optimal one, median of 5 seeds",
         .target = "<= 1.1",
         .run = cost_over_optimum},
        {.part = 6,
         .id = "trainers-swing-up",
         .sentence = "mean return of a pendulum swung up, after 8000 steps",
         .target = ">= -200",
         .run = swing_up},
    };
}

}  // namespace ricochet::bench
