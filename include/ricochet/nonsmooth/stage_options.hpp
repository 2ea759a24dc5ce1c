// How a stage of an implicit step is solved.
#pragma once

namespace ricochet {

/// Method by which a stage is solved.
enum class StageMethod {
    automatic,    ///< cases for boxes of up to four reactions, else Newton's method
    cases,        ///< Newton's method on f alone, the inequality solved exactly by cases
    newton,       ///< semismooth Newton on equation and law together
    fixed_point,  ///< projected fixed point with an adapted step, as in the source
};

/// How the stages of implicit steps are solved.
struct StageOptions {
    StageMethod method = StageMethod::automatic;
    double tolerance = 1e-12;  ///< of the residual
    int max_iterations = 50;   ///< of the fixed point: a hundred times as many
    bool line_search = true;   ///< of `newton`
};

}  // namespace ricochet
