#include "measure_fault.hpp"

#include <fmt/format.h>
#include <malloc.h>

#include <cmath>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <string>

#include "ricochet/faults/strike_slip_fault.hpp"

namespace ricochet::bench {

namespace {

const std::filesystem::path kernels = RICOCHET_FAULT_KERNELS;
constexpr double mm = 1e3;

/// Processor time of this process: nothing here runs in a second thread.
class Clock {
public:
    [[nodiscard]] double seconds() const
    {
        return static_cast<double>(std::clock() - start_) / CLOCKS_PER_SEC;
    }

private:
    std::clock_t start_ = std::clock();
};

/// The largest resident size [MiB] of the whole process since it was made.
class PeakMemory {
public:
    PeakMemory()
    {
        malloc_trim(0);
        std::ofstream("/proc/self/clear_refs") << 5;
    }
    [[nodiscard]] double mib() const
    {
        std::ifstream in("/proc/self/status");
        for (std::string line; std::getline(in, line);) {
            if (line.starts_with("VmHWM:")) return std::stod(line.substr(6)) / 1024;
        }
        return std::nan("");
    }
};

StrikeSlipFault of_elements(int n, FaultMesh mesh = FaultMesh::plain)
{
    return StrikeSlipFault({.elements = n, .mesh = mesh});
}

StrikeSlipFault published(bool large)
{
    return StrikeSlipFault({.elements = 10,
                            .side = large ? 5000.0 : 3000.0,
                            .kernel = kernels / (large ? "fault-kernel-10x10-5km.npy"
                                                       : "fault-kernel-10x10-3km.npy")});
}

struct TimedRupture {
    Rupture run;
    double seconds = 0;  ///< including everything that is made before
    double mib = 0;
};

TimedRupture timed(int n, double step, FaultMesh mesh = FaultMesh::plain)
{
    const PeakMemory memory;
    const Clock clock;
    const StrikeSlipFault fault = of_elements(n, mesh);
    TimedRupture out{.run = simulate(fault, {.t_end = 30, .step = step})};
    out.seconds = clock.seconds();
    out.mib = memory.mib();
    return out;
}

Measured on_mesh(int n, double slip, double seconds, double mib)
{
    const TimedRupture usual = timed(n, 0);
    const double finer_step = usual.run.longest_step / 4;
    const double finer = n <= 100 ? timed(n, finer_step).run.mean_slip : usual.run.mean_slip;
    const double off = std::abs(usual.run.mean_slip / finer - 1);
    const auto& s = usual.run.statistics;
    Measured out;
    out.pass = std::abs(usual.run.mean_slip * mm - slip) <= 0.05 && off <= 2e-4 &&
               usual.seconds <= seconds && usual.mib <= mib;
    out.text = fmt::format(
        "slip {:.3f} mm, {}{:.2f} s, {:.1f} MiB", usual.run.mean_slip * mm,
        n <= 100 ? fmt::format("{:.4f} % from a quarter of the step, ", 100 * off) : std::string(),
        usual.seconds, usual.mib);
    out.details.push_back(fmt::format(
        "{} steps, {} force evaluations, {} products with K, {:.3f} ms each with all else; "
        "sqrt(K) by degree {} within {:.2g}; peak {:.6f} m/s at {:.4f} s, arrest at {:.3f} s",
        s.steps, s.evaluations, s.products, 1e3 * usual.seconds / static_cast<double>(s.products),
        s.degree, s.bound, usual.run.peak_velocity, usual.run.peak_time, usual.run.arrest_time));
    return out;
}

}  // namespace

Measured rupture_one_element()
{
    const Rupture r = simulate(StrikeSlipFault(), {.t_end = 30});
    Measured out;
    out.pass = std::abs(r.mean_slip * mm - 227.99875) <= 1e-4 &&
               std::abs(r.arrest_time - 12.683187) <= 1e-6 &&
               std::abs(r.peak_velocity - 0.0684778) <= 1e-7 &&
               std::abs(r.peak_time - 10.43650) <= 1e-5;
    out.text = fmt::format("{:.6f} mm, arrest {:.6f} s, peak {:.7f} m/s at {:.5f} s",
                           r.mean_slip * mm, r.arrest_time, r.peak_velocity, r.peak_time);
    return out;
}

Measured rupture_published_kernels()
{
    const double small = simulate(published(false), {.t_end = 30}).mean_slip * mm;
    const double large = simulate(published(true), {.t_end = 50}).mean_slip * mm;
    return {.pass = std::abs(small - 237.044) <= 0.005 && std::abs(large - 825.203) <= 0.01,
            .text = fmt::format("{:.4f} and {:.4f} mm", small, large)};
}

Measured repeat_published_scheme()
{
    const StrikeSlipFault fault = published(false);
    const BatheOptions constant{.first_stage = FirstStage::at_end};
    const auto slip = [&](double step, const BatheOptions& options) {
        return simulate(fault, {.t_end = 30, .step = step}, options).mean_slip * mm;
    };
    const double coarse = slip(0.5, constant);
    const double fine = slip(0.1, constant);
    const double controlled = slip(0.05, {.first_stage = FirstStage::at_end,
                                          .controller = ClassicStep{.order = 1, .up = 1.8},
                                          .estimate = ErrorEstimate::doubling,
                                          .norm = FaultNorm::components});
    return {.pass = std::abs(coarse - 243.671) <= 0.001 && std::abs(fine - 238.089) <= 0.001 &&
                    std::abs(controlled - 237.72) <= 0.1,
            .text = fmt::format("{:.3f}, {:.3f}; controlled {:.3f} mm", coarse, fine, controlled)};
}

Measured observe_order_through_arrests()
{
    const StrikeSlipFault fault = published(false);
    const double exact =
        simulate(fault, {.t_end = 30, .step = 0.01, .polynomial_bound = 1e-8}).mean_slip;
    Measured out{.pass = true, .text = {}};
    double before = 0;
    for (const double step : {0.5, 0.25, 0.125, 0.0625, 0.03125}) {
        const Rupture r =
            simulate(fault, {.t_end = 30, .step = step, .polynomial_bound = 1e-8}, BatheOptions{});
        const double error = std::abs(r.mean_slip - exact);
        if (before > 0) {
            const double ratio = before / error;
            out.pass = out.pass && ratio > 3.5 && ratio < 4.6 && r.statistics.arrests == 100;
            out.text += fmt::format("{}{:.2f}", out.text.empty() ? "" : ", ", ratio);
        }
        before = error;
    }
    return out;
}

Measured rupture_100()
{
#ifdef RICOCHET_WITH_FFTW
    return on_mesh(100, 249.773, 2, 64);
#else
    return on_mesh(100, 249.773, 8, 64);
#endif
}

Measured rupture_200()
{
    return on_mesh(200, 250.01, 60, 128);
}

Measured bathe_100()
{
    const Clock clock;
    const Rupture r = simulate(of_elements(100), {.t_end = 30, .step = 0.125}, BatheOptions{});
    const double seconds = clock.seconds();
    const double off = std::abs(r.mean_slip * mm / 249.7726 - 1);
    const auto& s = r.statistics;
    return {.pass = off <= 3e-4 && seconds <= 30,
            .text = fmt::format("slip {:.3f} mm, {:.4f} % off, {:.2f} s", r.mean_slip * mm,
                                100 * off, seconds),
            .details = {fmt::format("{} stages, {} Newton iterations, {} products with K", s.solves,
                                    s.iterations, s.products)}};
}

Measured table_of_meshes()
{
    // The limit of finer meshes, which plain and tip-corrected ones approach from opposite sides.
    constexpr double limit = 250.32;
    Measured out{.pass = true, .text = "below"};
    out.details.push_back(fmt::format("{:>5}{:>12}{:>9}{:>10}{:>10}{:>9}{:>9}{:>14}{:>9}", "n",
                                      "plain mm", "off %", "products", "time s", "MiB", "factor",
                                      "corrected mm", "off %"));
    double before = 0;
    for (const int n : {10, 25, 50, 100, 200, 400}) {
        const TimedRupture plain = timed(n, 0);
        const double slip = plain.run.mean_slip * mm;
        std::string corrected = fmt::format("{:>14}{:>9}", "-", "-");
        if (n <= 100) {
            const double other = timed(n, 0, FaultMesh::tip_corrected).run.mean_slip * mm;
            corrected = fmt::format("{:>14.3f}{:>9.3f}", other, 100 * (other / limit - 1));
            out.pass = out.pass && other > limit;
        }
        out.pass = out.pass && slip > before && slip < limit;
        before = slip;
        out.details.push_back(fmt::format("{:>5}{:>12.3f}{:>9.3f}{:>10}{:>10.2f}{:>9.1f}{:>9.5f}{}",
                                          n, slip, 100 * (slip / limit - 1),
                                          plain.run.statistics.products, plain.seconds, plain.mib,
                                          of_elements(n).factor(), corrected));
    }
    out.text = "slip rises with n towards 250.32 mm, that of corrected meshes falls";
    return out;
}

}  // namespace ricochet::bench
