// Proved bounds on the logit of a ReLU network over a box of features.
//
// *Method.* Forward, every neuron is an affine form in the box's own coordinates,
// h = c + G t +- e with t in [-1, 1]^d (Singh et al., "Fast and effective robustness
// certification", NeurIPS 2018, the parallelogram of least area for a ReLU of either sign).
// Backward, the logit is replaced from the last layer to the first by linear functions below
// it, with the ranges found forward (Zhang et al., "Efficient neural network robustness
// certification with general activation functions", NeurIPS 2018). The tighter bound counts.
//
// *Rounding.* The bounds hold for real arithmetic and for the logit as `Classifier` computes
// it. No rounding mode is changed, so that no compiler can undo it: with u = 2^-53 a sum of n
// products has an error of at most gamma_n = n u / (1 - n u) times the sum of the
// magnitudes (Higham, "Accuracy and Stability of Numerical Algorithms", 2002, eqs. 3.3-3.5),
// whatever its order and whether or not products are contracted. Forward that
// magnitude, |c| + |G| 1 + e, is put into e of the layer before; backward it is bounded over
// the domain once. Each gamma is taken twice as large as needed, which covers the rounding of
// the error terms themselves, and 1e-250 covers underflow. The rounding of
// the network's own evaluation, in its precision u', is bounded once over the domain by
//
//     e_k+1 <= |W| e_k + gamma'_n (|W| (|x| + e_k) + |b|),
//
// from the rounding of the normalised features on, and subtracted. The weights are those
// of the evaluation: rounded to float in a model of that precision.
#pragma once

#include <cstddef>
#include <vector>

#include "ricochet/nn/model.hpp"

namespace ricochet {

/// Bounds of the logit of one network, over boxes within its domain.
///
/// Immutable, so threads may share it; each needs a `Scratch` of its own.
class NetworkBounds {
public:
    static constexpr std::size_t max_inputs = 16;

    /// @throws std::invalid_argument in one sentence: if activations are not ReLU, there is more
    /// than one output, a weight, offset or scale is not finite, the domain has no finite
    /// range for each of at most `max_inputs` features, or numbers are so large that an
    /// evaluation over the domain could overflow.
    explicit NetworkBounds(const Model& model);

    /// Work space of one thread.
    class Scratch {
    public:
        explicit Scratch(const NetworkBounds& network);

    private:
        friend class NetworkBounds;
        std::vector<double> forms, previous;           ///< of one layer: c, G, e for each neuron
        std::vector<std::size_t> active, next_active;  ///< neurons that are not always zero
        std::vector<std::vector<double>> low, high;    ///< per layer, before its activation
        std::vector<double> back, front;
    };

    [[nodiscard]] std::size_t inputs() const noexcept { return inputs_; }

    /// The largest difference, over the domain, between the logit as computed and the logit in
    /// real arithmetic.
    [[nodiscard]] double evaluation_error() const noexcept { return evaluation_error_; }

    /// Whether the network depends on feature i at all: one of its weights is not zero.
    [[nodiscard]] bool depends_on(std::size_t i) const noexcept;

    /// A range that holds the computed logit of every raw feature vector with
    /// lower <= features <= upper, where the box lies within the domain. The backward pass is
    /// omitted if the forward one shows a logit of at least `enough`. A bound may be
    /// -inf, inf or NaN if the arithmetic of the bound overflows; NaN is no bound.
    /// @param influence  written, one per input: a rough measure of how much the logit can
    ///                   change along this edge of the box, for choosing where to cut; no bound
    [[nodiscard]] ValueRange over(const double* lower, const double* upper, double enough,
                                  Scratch& scratch, double* influence) const noexcept;

private:
    struct Layer {
        std::size_t inputs = 0;
        std::size_t outputs = 0;
        std::size_t blocks = 0;  ///< of four outputs
        std::vector<double>
            blocked;               ///< weight of output 4 b + l, input i, at (b inputs + i) 4 + l
        std::vector<double> rows;  ///< outputs x inputs
        std::vector<double> bias;  ///< padded to whole blocks
        std::vector<double> most;  ///< sum |w| |h| + |b| over the domain, per output
    };
    struct Place;  ///< the box in normalised features

    void check(const Model& model) const;
    void load(const Model& model);
    void bound_evaluation(const Model& model);
    [[nodiscard]] Place place(const double* lower, const double* upper) const noexcept;
    template <std::size_t D>
    void start(const Place& at, Scratch& s) const noexcept;
    template <std::size_t D>
    [[nodiscard]] ValueRange forward(const Place& at, Scratch& s, double* influence) const noexcept;
    [[nodiscard]] ValueRange forward(const Place& at, Scratch& s, double* influence) const noexcept;
    [[nodiscard]] double backward(const Place& at, Scratch& s) const noexcept;

    std::size_t inputs_ = 0;
    std::vector<std::size_t> live_;  ///< inputs that the network depends on
    std::vector<double> offset_, scale_;
    std::vector<Layer> layers_;
    double evaluation_error_ = 0;
    double backward_gamma_ = 0;
};

}  // namespace ricochet
