// The one training set that takes seconds to make.
#include "training_data.hpp"

namespace ricochet::studies::training_data_full_test {
namespace {

TEST(ImpactOscillatorGate, IsTheStoredSetAndTheOneThatTheNetworkIsScaledBy)
{
    const TrainingSet set = data_of("impact-oscillator-gate").make({});
    expect_stored("impact-oscillator-gate", set);
    expect_trained_on("impact-oscillator-gate", set, 1e-9);
}

}  // namespace
}  // namespace ricochet::studies::training_data_full_test
