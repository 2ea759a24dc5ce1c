// Detectors that ask a network, for systems known at run time.
#include <array>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>

#include "ricochet/detail/finders.hpp"
#include "ricochet/gates.hpp"
#include "setup.hpp"

namespace ricochet::python {

namespace {

/// The system at the adapter of a run, with the functions that detectors use.
class AskedSystem {
public:
    AskedSystem(const Source& source, RunAdapter& adapter)
        : name(adapter.table().name(adapter.adapter())), source_(&source), adapter_(&adapter)
    {
    }

    void flow(Mode mode, double t, const State& x, State& dxdt) const
    {
        (void)adapter_->table().flow(adapter_->adapter(), mode, t, x, dxdt);
    }
    [[nodiscard]] double guard(double /*t*/, const State& /*x*/) const { return 1; }
    [[nodiscard]] double speed_bound(double /*t*/, const State& /*x*/) const { return 0; }
    [[nodiscard]] std::size_t mode_count() const
    {
        return adapter_->table().moded ? adapter_->table().mode_count(adapter_->adapter()) : 0;
    }
    [[nodiscard]] std::optional<double> parameter(std::string_view of) const
    {
        const auto found = source_->parameters.find(of);
        if (found == source_->parameters.end()) return std::nullopt;
        return found->second;
    }

    std::string name;

private:
    const Source* source_;
    RunAdapter* adapter_;
};

/// A detector together with its system. The loop passes the adapter of the run, whose type the
/// detector does not know.
template <class Detector>
class At : public Detector {
public:
    template <class Asked>
    At(AskedSystem system, Asked&& asked)
        : Detector(std::forward<Asked>(asked)), system_(std::move(system))
    {
    }

    void add_to(OwnedSetup& out, std::shared_ptr<const At> self) const
    {
        auto& table = out.setup.detector;
        table = detail::DetectorTableOf<Detector, AskedSystem, State>::make(*this);
        table.check = [](const void* at, void*, const State& x, double smallest, double largest) {
            from(at).Detector::check(from(at).system_, x, smallest, largest);
        };
        if constexpr (requires(const State& x) { this->horizon(system_, Mode{}, 0.0, x); }) {
            table.horizon = [](const void* at, void*, Mode mode, double t, const State& x) {
                const auto answer = from(at).Detector::horizon(from(at).system_, mode, t, x);
                return detail::GateAnswer{answer.cleared, answer.outside};
            };
        }
        if constexpr (requires(const State& x) {
                          this->level(system_, std::size_t{}, Mode{}, 0.0, x);
                      }) {
            table.level = [](const void* at, void*, GuardInMode of, double t, const State& x) {
                const auto answer =
                    from(at).Detector::level(from(at).system_, of.which, of.mode, t, x);
                return detail::GateAnswer{answer.cleared, answer.outside};
            };
        }
        if constexpr (std::is_same_v<Detector, BareNetwork>) {
            table.clears = [](const void* at, void*, const detail::StepState<State>& step,
                              std::uint64_t& calls) {
                detail::SystemAdapter<AskedSystem, State> adapter(from(at).system_, step.x0);
                const detail::GuardView<AskedSystem, State> guard(
                    from(at).system_, calls, {.mode = step.mode, .backward = step.backward});
                return from(at).Detector::clears(
                    guard, detail::StepToCome<AskedSystem, State>(adapter, step));
            };
        }
        out.setup.detecting = static_cast<const Detector*>(self.get());
        out.detector = std::move(self);
    }

private:
    [[nodiscard]] static const At& from(const void* detector) noexcept
    {
        return static_cast<const At&>(*static_cast<const Detector*>(detector));
    }

    AskedSystem system_;
};

template <class Detector, class Asked>
void detect_by(OwnedSetup& out, const Source& source, RunAdapter& adapter, Asked&& asked)
{
    const auto kept = std::make_shared<const At<Detector>>(AskedSystem(source, adapter),
                                                           std::forward<Asked>(asked));
    kept->add_to(out, kept);
}

}  // namespace

bool detect_by_gate(OwnedSetup& out, const Request& request, const Source& source,
                    RunAdapter& adapter)
{
    const std::string_view detector = request.detector;
    const auto model = [&] {
        if (request.gate) return Model(*request.gate);
        throw std::invalid_argument(
            "gate: found None, expected the path of a model, or a Network, "
            "for the detector '" +
            std::string(detector) + "'");
    };
    if (detector == "calibrated") {
        detect_by<Calibrated<>>(out, source, adapter, gates::Gate(model()));
    } else if (detector == "calibrated-bounds") {
        detect_by<CalibratedBounds<>>(out, source, adapter, gates::Gate(model()));
    } else if (detector == "foreseen") {
        detect_by<Foreseen<>>(out, source, adapter, gates::Gate(model()));
    } else if (detector == "certified") {
        detect_by<Certified<>>(out, source, adapter, model());
    } else if (detector == "network") {
        detect_by<BareNetwork>(out, source, adapter, model());
    } else {
        return false;
    }
    return true;
}

}  // namespace ricochet::python
