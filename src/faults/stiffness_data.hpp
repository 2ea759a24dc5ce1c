// The stiffness of a fault in the form in which a product needs it.
#pragma once

#include <Eigen/Core>
#include <vector>

namespace ricochet::detail {

/// Entries in the form in which a product needs them.
struct StiffnessData {
    enum class Form { toeplitz, layered, dense } form = Form::dense;
    int n = 1;       ///< elements per side
    int length = 1;  ///< of the transforms: a circle that holds distances of both signs
    /// toeplitz: eigenvalues of the periodic matrix of which K is a part, over length^2;
    /// [k / 2][depth's frequency][k % 2] for the frequencies k <= length / 2 along x
    std::vector<double> symbol;
    /// layered: for each frequency along x a matrix of rows by rows, over length
    std::vector<Eigen::MatrixXd> layers;
    /// dense; also for a small toeplitz mesh, where it takes less time than transforms
    Eigen::MatrixXd matrix;
    double upper = 0;  ///< bound of the eigenvalues

    [[nodiscard]] int frequencies() const { return length / 2 + 1; }
};

}  // namespace ricochet::detail
