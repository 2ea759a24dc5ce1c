#include "branch_and_bound.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <bit>
#include <chrono>
#include <cmath>
#include <deque>
#include <span>

#include "ricochet/base/random.hpp"

namespace ricochet::learn {

namespace {

constexpr double unit = 0x1p-53;
using Point = std::array<double, most_features>;

double middle(double lower, double upper) noexcept
{
    return lower + (upper - lower) / 2;
}

Point centre_of(const Box& box, std::size_t n) noexcept
{
    Point c{};
    for (std::size_t i = 0; i < n; ++i) c[i] = middle(box.lower[i], box.upper[i]);
    return c;
}

/// Half-widths about the centre, rounded up; 0 for an edge without length.
Point half_of(const Box& box, const Point& centre, std::size_t n) noexcept
{
    Point half{};
    for (std::size_t i = 0; i < n; ++i) {
        const double h = std::max(centre[i] - box.lower[i], box.upper[i] - centre[i]);
        half[i] = h > 0 ? std::nextafter(h, std::numeric_limits<double>::infinity()) : 0;
    }
    return half;
}

std::string coordinates(const double* x, std::size_t n)
{
    return fmt::format("({})", fmt::join(std::span(x, n), ", "));
}

}  // namespace

Statement::Statement(const Classifier& classifier, const NetworkBounds& bounds,
                     const GuardProblem& problem, double smallest, double margin, double threshold)
    : classifier_(classifier),
      bounds_(bounds),
      problem_(problem),
      n_(bounds.inputs()),
      smallest_(smallest),
      margin_(margin),
      threshold_(threshold)
{
    const Box all = domain();
    const Point half = half_of(all, centre_of(all, n_), n_);
    for (std::size_t i = 0; i < n_; ++i) {
        Point alone{};
        alone[i] = half[i];
        guard_depends_.push_back(problem_.slack(alone.data()) != 0);
    }
}

Box Statement::domain() const
{
    Box box;
    for (std::size_t i = 0; i < n_; ++i) {
        box.lower[i] = classifier_.model().domain[i].lower;
        box.upper[i] = classifier_.model().domain[i].upper;
    }
    return box;
}

void Statement::check_slack(const Box& box, const double* centre, double guard) const
{
    // NaN where the guard of the parent was not evaluated. The allowance covers rounding, which a
    // slack may neglect without being far wrong.
    const double change = std::fabs(guard - box.parent_guard);
    const double rounding =
        1e-9 * std::max({std::fabs(guard), std::fabs(box.parent_guard), box.parent_slack});
    if (!(change > box.parent_slack + rounding)) return;
    throw std::invalid_argument(fmt::format(
        "certify: guard_slack is wrong: the guard is {} at {} and {} at {}, and changes by {} "
        "where at most {} is declared",
        box.parent_guard, coordinates(box.parent.data(), n_), guard, coordinates(centre, n_),
        change, box.parent_slack));
}

/// Stores its results in `parent`, `parent_guard` and `parent_slack`, for the halves.
bool Statement::proved_by_guard(Box& box) const
{
    const Point centre = centre_of(box, n_);
    const Point half = half_of(box, centre, n_);
    const double guard = problem_.guard(centre.data());
    check_slack(box, centre.data(), guard);
    const double slack = problem_.slack(half.data());
    box.parent = centre;
    box.parent_guard = guard;
    box.parent_slack = slack;
    if (!(slack >= 0)) return false;  // a slack that is not a number proves nothing
    const double rounding = 4 * unit * (std::fabs(guard) + slack + std::fabs(margin_));
    box.guard_spent = guard + slack + rounding <= margin_;
    return guard - slack - rounding > margin_;
}

/// Whether a box is among those examined closely, independently of the thread.
bool one_in_64(const Point& centre, std::size_t n) noexcept
{
    std::uint64_t hash = 0;
    for (std::size_t i = 0; i < n; ++i) {
        hash = (hash ^ std::bit_cast<std::uint64_t>(centre[i])) * 0x9e3779b97f4a7c15U;
        hash ^= hash >> 29U;
    }
    return hash >> 58U == 0;
}

/// Proves a box without the guard itself, which may be a thousand times as expensive; one box in 64
/// compares the guard with the bound.
bool Statement::proved_by_least(Box& box) const
{
    const Point centre = centre_of(box, n_);
    const double least = problem_.least(box.lower.data(), box.upper.data());
    if (least > margin_ && one_in_64(centre, n_)) {
        const double guard = problem_.guard(centre.data());
        if (guard < least - 1e-9 * std::max(std::fabs(guard), std::fabs(least))) {
            throw std::invalid_argument(fmt::format(
                "certify: guard_least is wrong: the guard is {} at {}, below {}, which is declared "
                "for the box from {} to {}",
                guard, coordinates(centre.data(), n_), least, coordinates(box.lower.data(), n_),
                coordinates(box.upper.data(), n_)));
        }
    }
    if (least > margin_) return true;
    // Where the bound is exact no guard in the box is above the margin.
    const Point half = half_of(box, centre, n_);
    box.guard_spent = least + 2 * problem_.slack(half.data()) <= margin_;
    return false;
}

bool Statement::proved_by_logit(Box& box, NetworkBounds::Scratch& scratch, double* influence) const
{
    const ValueRange range =
        bounds_.over(box.lower.data(), box.upper.data(), threshold_, scratch, influence);
    // A bound of the whole box holds for its parts, so bounds never get worse downwards.
    if (range.lower > box.low) box.low = range.lower;
    box.logit_spent = range.upper < threshold_;
    return box.low >= threshold_;
}

/// The edge along which the guard and the logit can change most, each relative to its change over
/// the whole box; edges that affect neither, or are too narrow, are not cut.
std::size_t Statement::choose_axis(const Box& box, const double* half,
                                   const double* influence) const
{
    Point slack{};
    double all_slack = 0;
    double all_influence = 0;
    for (std::size_t i = 0; i < n_; ++i) {
        if (!box.guard_spent && guard_depends_[i]) {
            Point alone{};
            alone[i] = half[i];
            const double change = problem_.slack(alone.data());
            slack[i] = std::isfinite(change) ? change : std::numeric_limits<double>::max() / 32;
            all_slack += slack[i];
        }
        all_influence += influence[i];
    }
    std::size_t best = n_;
    double most = 0;
    for (std::size_t i = 0; i < n_; ++i) {
        const ValueRange& range = classifier_.model().domain[i];
        const double m = middle(box.lower[i], box.upper[i]);
        const bool wide = box.upper[i] - box.lower[i] > smallest_ * (range.upper - range.lower) &&
                          box.lower[i] < m && m < box.upper[i];
        const double score = (all_slack > 0 ? slack[i] / all_slack : 0) +
                             (all_influence > 0 ? influence[i] / all_influence : 0);
        if (wide && score > most) {
            most = score;
            best = i;
        }
    }
    return best;
}

bool Statement::is_counterexample(const double* x) const
{
    return classifier_.logit(x) < threshold_ && problem_.guard(x) <= margin_;
}

Statement::Verdict Statement::examine(Box& box, NetworkBounds::Scratch& scratch,
                                      std::size_t& axis) const
{
    if (box.low >= threshold_) return Verdict::proved;
    if (box.guard_spent) {
        box.parent_guard = std::numeric_limits<double>::quiet_NaN();
    } else if (problem_.least ? proved_by_least(box) : proved_by_guard(box)) {
        return Verdict::proved;
    }
    Point influence{};
    if (!box.logit_spent && proved_by_logit(box, scratch, influence.data())) {
        return Verdict::proved;
    }
    const Point centre = centre_of(box, n_);
    const bool hopeless = box.guard_spent && box.logit_spent;
    if (!hopeless) {
        axis = choose_axis(box, half_of(box, centre, n_).data(), influence.data());
        if (axis < n_) return Verdict::cut;
    }
    return is_counterexample(centre.data()) ? Verdict::refuted : Verdict::stuck;
}

std::array<Box, 2> Statement::halves(const Box& box, std::size_t axis) const
{
    std::array<Box, 2> out{box, box};
    const double cut = middle(box.lower[axis], box.upper[axis]);
    out[0].upper[axis] = cut;
    out[1].lower[axis] = cut;
    return out;
}

void Statement::note(const Box& box, Verdict verdict, Tally& tally) const
{
    if (verdict == Verdict::refuted) {
        const Point centre = centre_of(box, n_);
        tally.counterexample.assign(centre.begin(),
                                    centre.begin() + static_cast<std::ptrdiff_t>(n_));
    }
    if (verdict != Verdict::stuck) return;
    tally.lowest = std::min(tally.lowest, box.low);
    std::vector<ValueRange> ranges;
    for (std::size_t i = 0; i < n_; ++i) ranges.push_back({box.lower[i], box.upper[i]});
    tally.unproved.push_back(std::move(ranges));
}

Frontier grow(const Statement& statement, std::size_t boxes)
{
    NetworkBounds::Scratch scratch(statement.bounds());
    std::deque<Box> open{statement.domain()};
    Frontier out;
    while (!open.empty() && open.size() < boxes && out.tally.counterexample.empty()) {
        Box box = open.front();
        open.pop_front();
        ++out.tally.boxes;
        std::size_t axis = 0;
        const Statement::Verdict verdict = statement.examine(box, scratch, axis);
        statement.note(box, verdict, out.tally);
        if (verdict != Statement::Verdict::cut) continue;
        for (const Box& half : statement.halves(box, axis)) open.push_back(half);
    }
    out.open.assign(open.begin(), open.end());
    return out;
}

bool explore(const Statement& statement, const Box& start, std::size_t max_unproved, Tally& tally,
             const std::function<bool(std::uint64_t boxes)>& stop)
{
    constexpr std::uint64_t every = 64;
    NetworkBounds::Scratch scratch(statement.bounds());
    std::vector<Box> open{start};
    std::uint64_t told = 0;
    while (!open.empty()) {
        Box box = open.back();
        open.pop_back();
        ++tally.boxes;
        std::size_t axis = 0;
        const Statement::Verdict verdict = statement.examine(box, scratch, axis);
        if (verdict == Statement::Verdict::cut) {
            const auto halves = statement.halves(box, axis);
            open.push_back(halves[1]);
            open.push_back(halves[0]);
        } else if (verdict != Statement::Verdict::proved) {
            statement.note(box, verdict, tally);
            if (!tally.counterexample.empty() || tally.unproved.size() > max_unproved) break;
        }
        if (tally.boxes - told >= every) {
            if (stop(tally.boxes - told)) return false;
            told = tally.boxes;
        }
    }
    static_cast<void>(stop(tally.boxes - told));
    return true;
}

namespace {

/// Adds one sample of the numbers of boxes below `box`, itself included, and of those among them
/// that are too narrow to be cut.
void descend(const Statement& statement, Box box, NetworkBounds::Scratch& scratch, Random& random,
             double& boxes, double& unproved, std::uint64_t& examined)
{
    for (double weight = 1;; weight *= 2) {
        boxes += weight;
        ++examined;
        std::size_t axis = 0;
        const Statement::Verdict verdict = statement.examine(box, scratch, axis);
        if (verdict == Statement::Verdict::proved) return;
        if (verdict != Statement::Verdict::cut) {
            unproved += weight;
            return;
        }
        box = statement.halves(box, axis)[random.below(2)];
    }
}

}  // namespace

Estimate estimate_below(const Statement& statement, const Frontier& frontier, std::size_t rounds,
                        std::uint64_t seed)
{
    using Clock = std::chrono::steady_clock;
    constexpr double good = 0.05;
    Estimate out;
    const auto seen = static_cast<double>(frontier.tally.boxes);
    out.unproved = static_cast<double>(frontier.tally.unproved.size());
    out.boxes = seen;
    if (frontier.open.empty()) return out;

    NetworkBounds::Scratch scratch(statement.bounds());
    Random random(seed);
    const auto start = Clock::now();
    std::uint64_t examined = 0;
    double sum = 0;
    double squares = 0;
    double stuck = 0;
    double done = 0;
    while (done < static_cast<double>(rounds)) {
        double boxes = 0;
        for (const Box& box : frontier.open) {
            descend(statement, box, scratch, random, boxes, stuck, examined);
        }
        sum += boxes;
        squares += boxes * boxes;
        ++done;
        const double mean = sum / done;
        const double variance =
            done > 1 ? (squares / done - mean * mean) / (done - 1) : mean * mean;
        out.boxes = seen + mean;
        out.error = std::sqrt(std::max(variance, 0.0)) / out.boxes;
        if (done >= 4 && out.error < good) break;
    }
    out.unproved += stuck / done;
    const double seconds = std::chrono::duration<double>(Clock::now() - start).count();
    out.seconds = seconds / static_cast<double>(examined) * out.boxes;
    return out;
}

}  // namespace ricochet::learn
