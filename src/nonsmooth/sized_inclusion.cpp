#include "sized_inclusion.hpp"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <string_view>
#include <utility>

#include "ricochet/nonsmooth/detail/inclusion_sizes.hpp"
#include "ricochet/nonsmooth/detail/phased_run.hpp"
#include "ricochet/nonsmooth/hand_over.hpp"

namespace ricochet::detail {

namespace {

/// A box of `count` of M reactions. The others are zero.
template <int M>
struct SizedBox {
    static constexpr auto room = static_cast<std::size_t>(M);
    std::size_t count;
    std::array<double, room> lower_{}, upper_{};

    [[nodiscard]] std::size_t dimension() const noexcept { return count; }
    [[nodiscard]] double lower(std::size_t i) const noexcept { return lower_[i]; }
    [[nodiscard]] double upper(std::size_t i) const noexcept { return upper_[i]; }
    void project(std::span<const double> z, std::span<double> p) const { clamp(*this, z, p); }
    void derivative(std::span<const double> z, std::span<double> d) const
    {
        clamp_derivative(*this, z, d);
    }
    [[nodiscard]] std::string_view fault() const noexcept
    {
        for (std::size_t i = 0; i < count; ++i) {
            const std::string_view fault = interval_fault(lower_[i], upper_[i]);
            if (!fault.empty()) return fault;
        }
        return "";
    }
};

/// Pads an inclusion to N components and M reactions as any_inclusion.hpp describes.
template <int N, int M>
struct SizedSystem {
    static constexpr int state_size = N, reaction_size = M;
    using Vector = Eigen::Matrix<double, N, 1>;
    using Reaction = Eigen::Matrix<double, M, 1>;

    Shared<const SizedInclusion> of;

    void smooth(double t, const Vector& w, Vector& f) const
    {
        f.setZero();
        of->smooth(t, w.data(), f.data());
    }
    [[nodiscard]] SizedBox<M> reaction_set(double t, const Vector& w) const
    {
        SizedBox<M> box{of->reactions()};
        of->bounds(t, w.data(), box.lower_.data(), box.upper_.data());
        return box;
    }
    void mass(Eigen::Matrix<double, N, N>& a) const
    {
        a.setIdentity();
        copy(of->matrices().mass, of->size(), of->size(), a);
    }
    template <class Matrix>
    void observe(Matrix& e) const
    {
        e.setZero();
        if (copy(of->matrices().observe, of->reactions(), of->size(), e)) return;
        for (std::size_t i = 0; i < of->reactions(); ++i) e(index(i), index(i)) = 1;
    }
    template <class Matrix>
    void act(Matrix& g) const
    {
        g.setZero();
        if (copy(of->matrices().act, of->size(), of->reactions(), g)) return;
        Eigen::Matrix<double, M, N> e;
        observe(e);
        g = e.transpose();
    }
    [[nodiscard]] bool has_own_offset() const { return of->has_offset(); }
    void offset(double t, Reaction& s) const
    {
        const Eigen::Index own = index(of->reactions());
        for (Eigen::Index i = 0; i < M; ++i) s[i] = i < own ? 0 : -1;
        of->offset(t, s.data());
    }
    void offset_rate(double t, Reaction& rate) const
    {
        rate.setZero();
        of->offset_rate(t, rate.data());
    }

private:
    [[nodiscard]] static Eigen::Index index(std::size_t i) { return static_cast<Eigen::Index>(i); }
    /// Whether there is a matrix to copy.
    template <class Matrix>
    static bool copy(const std::vector<double>& from, std::size_t rows, std::size_t columns,
                     Matrix& to)
    {
        if (from.empty()) return false;
        for (std::size_t i = 0; i < rows; ++i) {
            for (std::size_t j = 0; j < columns; ++j) {
                to(index(i), index(j)) = from[i * columns + j];
            }
        }
        return true;
    }
};

/// The same with static friction above kinetic friction.
template <int N, int M>
struct HeldSystem : SizedSystem<N, M> {
    [[nodiscard]] double static_bound(double t, const typename SizedSystem<N, M>::Vector& w,
                                      int i) const
    {
        std::array<double, static_cast<std::size_t>(M)> bounds{};
        this->of->static_bounds(t, w.data(), bounds.data());
        return bounds[static_cast<std::size_t>(i)];
    }
};

template <class System>
[[nodiscard]] Owner<BranchPhases> make_by(const Shared<const SizedInclusion>& inclusion,
                                          const BranchPhasesOptions& options)
{
    constexpr int N = System::state_size, M = System::reaction_size;
    const auto n = static_cast<Eigen::Index>(inclusion->size());
    const auto m = static_cast<Eigen::Index>(inclusion->reactions());
    const AnyInclusion<N, M> any(inclusion_table<System, N, M>,
                                 std::make_shared<const System>(System{{inclusion}}), n, m);
    return make_branch_phases<N, M>(any, options);
}

template <int N, int M>
[[nodiscard]] Owner<BranchPhases> make_of(const Shared<const SizedInclusion>& inclusion,
                                          const BranchPhasesOptions& options)
{
    if (inclusion->has_static_bounds()) return make_by<HeldSystem<N, M>>(inclusion, options);
    return make_by<SizedSystem<N, M>>(inclusion, options);
}

}  // namespace

Owner<BranchPhases> make_branch_phases(Shared<const SizedInclusion> inclusion,
                                       const BranchPhasesOptions& options)
{
    const std::size_t n = inclusion->size(), m = inclusion->reactions();
    const auto fits = [&](std::size_t components, std::size_t reactions) {
        return n <= components && m <= reactions;
    };
    if (n == 0 || m == 0 || !fits(most_components, most_reactions)) {
        refuse_inclusion(
            fmt::format("a state of 1 to {} components and 1 to {} reactions are "
                        "followed, not {} and {}",
                        most_components, most_reactions, n, m));
    }
    if (fits(1, 1)) return make_of<1, 1>(inclusion, options);
    if (fits(2, 1)) return make_of<2, 1>(inclusion, options);
    if (fits(3, 1)) return make_of<3, 1>(inclusion, options);
    if (fits(4, 2)) return make_of<4, 2>(inclusion, options);
    return make_of<8, 4>(inclusion, options);
}

}  // namespace ricochet::detail
