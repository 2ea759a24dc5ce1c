// Internal: what it declares may change without notice.
//
// A step divided until a cubic through the ends of each part tells what the guard does.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

#include "ricochet/detail/cubic_look.hpp"
#include "ricochet/detect/step_probe.hpp"

namespace ricochet::detail {

/// The inner nodes of one guard's parts in the step in hand. The step stands: its polynomial
/// is evaluated, at the price of guard calls alone.
class ResolvedParts {
public:
    /// Forgets the nodes: another step.
    void clear() noexcept { guard_ = nobody; }

    /// Divides the stretch that guard i is watched in, unless it is divided already.
    /// `everywhere`: at all places of `CubicLook::places` to begin with.
    template <class Probe>
    void resolve(Probe& probe, std::size_t i, const Watch& watch, double declared_touch,
                 bool everywhere)
    {
        const GuardSample& start = watch.start;
        const GuardSample& end = watch.end;
        whole_ = watch;
        if (guard_ == i) return;
        guard_ = i;
        count_ = 0;
        many_.clear();
        divided_ = unresolved_ = nearly_cubic_ = false;
        if (!std::isfinite(start.rate) || !std::isfinite(end.rate)) return;
        noise_ = -1;
        declared_touch_ = declared_touch;
        const double smallest = smallest_part * probe.step().h();
        if (!everywhere) return divide(probe, start, end, smallest, 0);
        GuardSample from = start;
        const double width = end.s - start.s;
        for (const double u : CubicLook::places) {
            const GuardSample node = probe.dense_value_and_rate(start.s + u * width);
            divide(probe, from, node, smallest, 1);
            if (node.value != 0) keep(node);
            from = node;
        }
        divided_ = true;
        divide(probe, from, end, smallest, 1);
    }

    /// The first node beyond offset s and before `end`, else null.
    [[nodiscard]] const GuardSample* next(double s, double end) const noexcept
    {
        for (std::size_t i = 0; i < count_; ++i) {
            const GuardSample& node = i < few_.size() ? few_[i] : many_[i - few_.size()];
            if (node.s > s) return node.s < end ? &node : nullptr;
        }
        return nullptr;
    }

    [[nodiscard]] bool divided() const noexcept { return divided_; }
    /// Whether the guard is a cubic in the whole stretch but for a 64th of its size.
    [[nodiscard]] bool nearly_cubic() const noexcept { return nearly_cubic_; }
    [[nodiscard]] const Watch& whole() const noexcept { return whole_; }
    [[nodiscard]] bool unresolved() const noexcept { return unresolved_; }

private:
    static constexpr std::size_t nobody = static_cast<std::size_t>(-1);
    static constexpr double smallest_part = 0x1p-12;  ///< of the step
    /// Where a stretch is divided: nowhere that a symmetry of the guard could single out.
    static constexpr double cut = 0.4142135;
    static constexpr int shallow = 3;  ///< divisions before rounding is thought of

    template <class Probe>
    void divide(Probe& probe, const GuardSample& start, const GuardSample& end, double smallest,
                int depth)
    {
        const double width = end.s - start.s;
        const CubicLook look(start.value, start.rate, end.value, end.rate, width);
        double deviation = 0;
        for (const double u : {CubicLook::inside, CubicLook::further}) {
            const double e = look.deviation(u, probe.dense_value(start.s + u * width).value);
            deviation = e <= deviation ? deviation : e;  // NaN stays
        }
        if (start.s == whole_.start.s && end.s == whole_.end.s) {
            nearly_cubic_ = CubicLook::most * deviation <= look.size();
        }
        if (look.stays_clear(deviation) || look.keeps_shape(deviation)) return;
        if (look.size() + deviation <= declared_touch_) return;
        if (width <= smallest) {
            // A kink keeps its shape however short the part.
            unresolved_ = unresolved_ || !(deviation <= 0x1p-24 * look.size());
            return;
        }
        // Rounding has none; that of a guard that decays is less here than where it was asked for.
        if (depth >= shallow && !(noise_ >= 0)) noise_ = probe.blur(end.s);
        if (deviation <= noise_) noise_ = probe.blur(end.s);
        if (deviation <= noise_) return;
        const GuardSample middle = probe.dense_value_and_rate(start.s + cut * width);
        divided_ = true;
        divide(probe, start, middle, smallest, depth + 1);
        // A node that cannot be told from the surface is no end of a part.
        constexpr double ulps = 64 * std::numeric_limits<double>::epsilon();
        const double touch = std::max(declared_touch_, ulps * look.size());
        if (std::fabs(middle.value) > std::max(noise_, touch)) keep(middle);
        divide(probe, middle, end, smallest, depth + 1);
    }

    void keep(const GuardSample& node)
    {
        if (count_ < few_.size()) {
            few_[count_] = node;
        } else {
            many_.push_back(node);
        }
        ++count_;
    }

    std::size_t guard_ = nobody;
    Watch whole_;                      ///< the stretch that is divided
    std::size_t count_ = 0;            ///< of nodes
    std::array<GuardSample, 32> few_;  ///< the first of them: seldom more, and no allocation
    std::vector<GuardSample> many_;    ///< the others
    double declared_touch_ = 0;
    double noise_ = -1;  ///< of the guard by rounding of the state; below 0: not asked for
    bool divided_ = false;
    bool nearly_cubic_ = false;
    bool unresolved_ = false;
};

}  // namespace ricochet::detail
