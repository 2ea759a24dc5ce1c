// A fault of 2 x 2 elements with rate-and-state friction as an FMU: its state has a size that is
// known when the library is loaded, and its steps are implicit.
#include <array>
#include <ricochet/faults/fault_system.hpp>
#include <ricochet/fmi/export.hpp>
#include <ricochet/rosenbrock.hpp>
#include <string>
#include <vector>

namespace {

struct Fault {
    using Method = ricochet::Rosenbrock4;
    static constexpr double rtol = 1e-9, t_end = 30;
    static constexpr ricochet::fmi::Exported parameters[] = {
        {"plate_velocity", 1e-3, "m/s"}, {"overload", 1e-3}, {"slip_rate", 2e-3, "m/s"}};
    static constexpr ricochet::fmi::Exported outputs[] = {
        {"slip[1]", 0, "m"}, {"slip[2]", 0, "m"}, {"slip[3]", 0, "m"}, {"slip[4]", 0, "m"}};

    static ricochet::RateStateFaultSystem make(std::span<const double> p)
    {
        return ricochet::RateStateFaultSystem(
            ricochet::StrikeSlipFault({.elements = 2}),
            {.plate_velocity = p[0], .slip_rate = p[2], .overload = p[1]});
    }
    static void get_outputs(const ricochet::RateStateFaultSystem& system, ricochet::Mode, double t,
                            const std::vector<double>& x, std::span<double> slip)
    {
        const Eigen::VectorXd d = system.slip(t, x);
        std::copy(d.begin(), d.end(), slip.begin());
    }

    static inline const std::vector<std::string> names = [] {
        std::vector<std::string> out;
        for (const char* const field : {"u", "log_rate", "xi"}) {
            for (int i = 1; i <= 4; ++i) out.push_back(field + ("[" + std::to_string(i) + "]"));
        }
        return out;
    }();
    static inline const std::vector<ricochet::fmi::Exported> states = [] {
        const std::vector<double> start = make(std::array{1e-3, 1e-3, 2e-3}).start();
        std::vector<ricochet::fmi::Exported> out;
        for (std::size_t i = 0; i < start.size(); ++i) out.push_back({names[i].c_str(), start[i]});
        return out;
    }();
};

}  // namespace
RICOCHET_FMU(Fault)
