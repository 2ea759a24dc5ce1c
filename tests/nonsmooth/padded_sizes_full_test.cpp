// Sizes that the library has not compiled, and the larger ones in which their systems run.

#include "padded_inclusions.hpp"

namespace ricochet::padded_inclusions_test {
namespace {

using test::compare;
using test::Dense;
using test::DenseInBall;

TEST(PaddedInclusions, TwoReactionsOfTwoComponents)
{
    compare<2, 2, 4, 2>(Dense<2, 2>{}, Dense<2, 2>::start(), 3, 0.05);
    compare<2, 2, 8, 4>(Dense<2, 2>{}, Dense<2, 2>::start(), 3, 0.05);
}

TEST(PaddedInclusions, ThreeReactionsOfFiveComponents)
{
    compare<5, 3, 8, 4>(Dense<5, 3>{}, Dense<5, 3>::start(), 3, 0.05);
    compare<5, 3, 8, 4>(DenseInBall<5, 3>{}, Dense<5, 3>::start(), 2, 0.05);
}

}  // namespace
}  // namespace ricochet::padded_inclusions_test
