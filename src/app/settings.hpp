// Settings of a run: the choices that the command line offers, by name.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "ricochet/gates.hpp"
#include "ricochet/methods.hpp"
#include "ricochet/options.hpp"

namespace ricochet {
class StepPolicy;
}

namespace ricochet::app {

struct SystemEntry;

/// A detector: one of `detail::NamedDetectors` by its place in that list, or one that needs a model
/// or a guard of a certain form.
enum class DetectorKind : std::uint8_t {
    extremum,
    ends,
    bernstein,
    network = 128,
    verified,
    line,
    certified,
    calibrated
};
enum class LocatorKind { newton, bisection, toms748 };
/// A method of `MethodName`, or Taylor series.
class Stepper {
public:
    Stepper(MethodName method) : method_(method) {}
    [[nodiscard]] static Stepper taylor() { return Stepper(); }

    [[nodiscard]] bool is_taylor() const noexcept { return !method_; }
    [[nodiscard]] bool estimates_error() const noexcept
    {
        return !method_ || ricochet::estimates_error(*method_);
    }
    [[nodiscard]] std::string_view name() const noexcept
    {
        return method_ ? ricochet::name(*method_) : "taylor";
    }
    /// @throws std::logic_error for Taylor series.
    [[nodiscard]] MethodName method() const
    {
        if (!method_) throw std::logic_error("the flow of this system has no series");
        return *method_;
    }

    friend bool operator==(const Stepper&, const Stepper&) = default;

private:
    Stepper() = default;

    std::optional<MethodName> method_;
};

[[nodiscard]] std::string_view name(DetectorKind kind) noexcept;
[[nodiscard]] std::string_view name(LocatorKind kind) noexcept;

/// Integration of a system that is a differential inclusion.
struct SetValuedSettings {
    std::string integrator = "handover";  ///< or "event", "bathe", "time-stepping"
    /// Step controller of bathe: "error", "heuristic", "pi", "filter", "learned".
    std::string controller = "constant";
    double step = 0;                             ///< [s] of set-valued steps
    std::shared_ptr<const StepPolicy> policy{};  ///< of "learned"
};

/// Everything needed to run a system.
struct RunSettings {
    std::vector<double> parameters;  ///< in the order of the system's
    std::vector<double> start{};     ///< in place of the start that the parameters give; empty: not
                                     ///< given
    Options options;
    Stepper stepper = MethodName::dopri5;
    bool fixed_step = false;  ///< else error control
    DetectorKind detector{};  ///< the first of the list
    LocatorKind locator = LocatorKind::newton;
    std::optional<BareNetwork> network{};  ///< of the detectors `network` and `verified`
    std::optional<Model> gate{};           ///< of `certified` and `calibrated`, and of `verified`
    std::filesystem::path model{};         ///< the file of either
    std::optional<SetValuedSettings> set_valued{};
};

/// The start in the settings, or else x0.
template <class X>
[[nodiscard]] X chosen_start(X x0, const RunSettings& settings)
{
    for (std::size_t i = 0; i < settings.start.size(); ++i) x0[i] = settings.start[i];
    return x0;
}

/// A run as requested. Absent values have defaults.
struct RunRequest {
    std::vector<std::string> set{};  ///< name=value
    std::optional<double> t_start{}, t_end{};
    std::optional<std::string> mode{};  ///< at the start, by name
    std::optional<std::string> detector{}, gate{}, locator{}, stepper{}, model{};
    std::optional<double> step{}, rtol{}, atol{}, event_tolerance{};
    std::optional<std::uint64_t> max_steps{};
    std::optional<std::string> integrator{}, controller{};  ///< of set-valued systems

    friend bool operator==(const RunRequest&, const RunRequest&) = default;
};

/// The values of a system's parameters, in its order, after "name=value"s.
/// @throws BadInput for a name it does not have or a value out of range.
[[nodiscard]] std::vector<double> parameter_values(const SystemEntry& system,
                                                   const std::vector<std::string>& set);

/// Fills in the defaults, and loads the model that the detector needs.
///
/// With `step` the stepper takes fixed steps, by default rk4; without, it
/// is error-controlled, by default dopri5. A model without a detector implies
/// the detector `network`.
///
/// @throws BadInput or ModelError, in words of the command line.
[[nodiscard]] RunSettings resolve(const SystemEntry& system, const RunRequest& request);

/// "dopri5, rtol 1e-08, atol 1e-10" or "rk4, step 0.01 s".
[[nodiscard]] std::string describe_stepping(const RunSettings& settings);

}  // namespace ricochet::app
