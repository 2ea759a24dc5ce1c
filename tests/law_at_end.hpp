// How far a run of an inclusion breaks its law at its end.
#pragma once

#include "ricochet/nonsmooth/hand_over.hpp"

namespace ricochet::test {

/// `law_violation` at the end of a run by set-valued steps of length `h`, by the matrices of the
/// size in which the system runs: those of its own size need not be compiled.
template <class System, class Run>
[[nodiscard]] double law_violation_at_end(const System& system, const Run& run, double h)
{
    constexpr int N = detail::solver_components<System::state_size, System::reaction_size>;
    constexpr int M = detail::solver_reactions<System::state_size, System::reaction_size>;
    const detail::AnyMatrices<N, M> matrices(detail::inclusion_of<N, M>(system));
    using Reaction = Eigen::Matrix<double, System::reaction_size, 1>;
    const Reaction reaction = Eigen::Map<const Reaction>(run.reaction.data());
    return law_violation(matrices, run.t, detail::resized<N>(run.x), detail::resized<M>(reaction),
                         h);
}

}  // namespace ricochet::test
