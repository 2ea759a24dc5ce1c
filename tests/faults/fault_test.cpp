// The strike-slip fault: kernels, products, polynomials, ruptures.
#include <gtest/gtest.h>
#include <unistd.h>

#include <Eigen/Eigenvalues>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <numbers>
#include <string>

#include "faults/fault_kernel.hpp"
#include "faults/stiffness_series.hpp"
#include "refusal.hpp"
#include "ricochet/faults/strike_slip_fault.hpp"

namespace ricochet::fault_test {
namespace {

namespace fs = std::filesystem;

const fs::path kernels = fs::path(RICOCHET_TEST_FIXTURES) / "fault_kernels";

bool contains(const std::string& text, std::string_view part)
{
    return text.find(part) != std::string::npos;
}

Eigen::MatrixXd dense_matrix(const FaultStiffness& stiffness)
{
    const auto n = static_cast<Eigen::Index>(stiffness.size());
    StiffnessProduct product(stiffness);
    Eigen::MatrixXd out(n, n);
    for (Eigen::Index i = 0; i < n; ++i) {
        const Eigen::VectorXd unit = Eigen::VectorXd::Unit(n, i);
        product(unit.data(), out.col(i).data());
    }
    return out;
}

TEST(FaultKernel, FullSpaceSelfStressOfASquareIsKnown)
{
    // Four equal corners at p = q = a/2: -(1 / (1 - nu) + 1) sqrt(2) / (pi a).
    const double expected = -(1 / 0.75 + 1) * std::numbers::sqrt2 / std::numbers::pi;
    EXPECT_NEAR(full_space_stress(0, 0, 1, 1, 0.25), expected, 1e-14);
    EXPECT_NEAR(full_space_stress(0, 0, 100, 100, 0.25), expected / 100, 1e-16);
}

TEST(FaultKernel, HalfSpaceIsTheFullSpaceFarBelowTheSurface)
{
    // The image is 2000 sides away: (1/2000)^3 of the self stress, times a few.
    EXPECT_NEAR(half_space_stress(0.3, 1000, 1000.2, 1, 1, 0.25),
                full_space_stress(0.3, -0.2, 1, 1, 0.25), 1e-9);
}

TEST(FaultKernel, LongStripUnderASurfaceHasAMirrorImage)
{
    // Antiplane shear: the surface is a mirror. The ends, a length l away, add (1 / l)^2.
    const double strip = half_space_stress(0, 1.5, 0.5, 2e4, 1, 0.25);
    const double mirrored =
        full_space_stress(0, 1, 2e4, 1, 0.25) + full_space_stress(0, 2, 2e4, 1, 0.25);
    EXPECT_NEAR(strip, mirrored, 1e-7);
}

TEST(FaultKernel, SmallRectanglesActOnEachOtherAlike)
{
    // Betti: the stress is reciprocal up to the size of the rectangle over the distance, squared.
    for (const double dx : {0.0, 0.7}) {
        const double down = half_space_stress(dx, 2, 1, 1e-3, 1e-3, 0.25);
        const double up = half_space_stress(dx, 1, 2, 1e-3, 1e-3, 0.25);
        EXPECT_NEAR(down, up, 1e-5 * std::abs(up)) << dx;
    }
}

TEST(FaultKernel, TopRowUnderASurfaceIsSofterByElevenPercent)
{
    // -0.934929 by an independent program that differentiates displacements numerically.
    EXPECT_NEAR(half_space_stress(0, 0.5, 0.5, 1, 1, 0.25), -0.934929, 2e-5);
}

TEST(FaultStiffness, ProductsByTransformsAreThoseOfTheMatrix)
{
    // Rounding of transforms: a few ulp times log n.
    for (const int n : {1, 2, 3, 4, 5, 7, 12}) {
        const auto by_distance = [](int dx, int dz) {
            return 3 / (1.0 + dx * dx + 0.3 * dz) + (dx + dz == 0 ? 9 : 0);
        };
        const auto matrix_of = [&](int i, int j) {
            return by_distance(std::abs(i % n - j % n), std::abs(i / n - j / n));
        };
        const FaultStiffness toeplitz = FaultStiffness::toeplitz(n, by_distance);
        const FaultStiffness layered = FaultStiffness::layered(
            n, [&](int dx, int r, int s) { return by_distance(dx, std::abs(r - s)); });
        const Eigen::MatrixXd a = dense_matrix(toeplitz);
        const Eigen::MatrixXd b = dense_matrix(layered);
        for (int i = 0; i < n * n; ++i) {
            for (int j = 0; j < n * n; ++j) {
                EXPECT_NEAR(a(i, j), matrix_of(i, j), 1e-13) << n;
                EXPECT_NEAR(b(i, j), matrix_of(i, j), 1e-13) << n;
            }
        }
    }
}

TEST(FaultStiffness, SpectrumHoldsTheEigenvalues)
{
    for (const FaultMedium medium : {FaultMedium::full_space, FaultMedium::half_space}) {
        const StrikeSlipFault fault({.elements = 12, .medium = medium});
        const Eigen::MatrixXd k = dense_matrix(fault.stiffness());
        EXPECT_LT((k - k.transpose()).norm(), 1e-13 * k.norm());
        const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(k);
        const detail::Spectrum spectrum = fault.stiffness().spectrum();
        EXPECT_LE(spectrum.lower, solver.eigenvalues().minCoeff());
        EXPECT_GE(spectrum.lower, 0.9 * solver.eigenvalues().minCoeff());
        EXPECT_GE(spectrum.upper, solver.eigenvalues().maxCoeff());
        EXPECT_LE(spectrum.upper, 1.4 * solver.eigenvalues().maxCoeff());
    }
}

TEST(FaultStiffness, FactorsAreThoseOfTheLiterature)
{
    // One element is a spring; the published matrices have 1.24362 and 0.523076.
    EXPECT_NEAR(dense_matrix(StrikeSlipFault().stiffness())(0, 0), 1, 1e-14);
    EXPECT_NEAR(StrikeSlipFault({.elements = 10}).factor(), 0.448018, 1e-6);
    EXPECT_NEAR(StrikeSlipFault({.elements = 25}).factor(), 0.413334, 1e-6);
    EXPECT_NEAR(StrikeSlipFault({.elements = 10, .kernel = kernels / "fault-kernel-10x10-3km.npy"})
                    .factor(),
                0.523076, 1e-6);
    EXPECT_NEAR(
        StrikeSlipFault({.elements = 1, .kernel = kernels / "fault-kernel-1x1-3km.npy"}).factor(),
        1.24362, 1e-5);
    // The tip-corrected mesh converges faster, to 0.39002.
    EXPECT_NEAR(StrikeSlipFault({.elements = 40, .mesh = FaultMesh::tip_corrected}).factor(),
                0.39002, 3e-4);
}

TEST(StiffnessSeries, PolynomialIsWithinItsBoundOnTheMatrix)
{
    const StrikeSlipFault fault({.elements = 10});
    const Eigen::MatrixXd k = dense_matrix(fault.stiffness());
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(k);
    const auto root = [](double x) { return std::sqrt(x); };
    for (const double bound : {1e-2, 1e-5, 1e-9}) {
        const auto series = StiffnessSeries::within(root, fault.stiffness().spectrum(), bound);
        EXPECT_LE(series.relative_error(root), bound);
        const StiffnessSeries shorter(root, fault.stiffness().spectrum(), series.degree() - 1);
        EXPECT_GT(shorter.relative_error(root), bound);
        // In the eigenbasis the error of each component is at most the bound.
        StiffnessProduct product(fault.stiffness());
        StiffnessSeries::Scratch scratch;
        const Eigen::VectorXd x = solver.eigenvectors() * Eigen::VectorXd::Ones(100);
        Eigen::VectorXd y(100);
        series.apply(product, x, y, scratch);
        EXPECT_EQ(product.count(), static_cast<std::uint64_t>(series.degree()));
        const Eigen::VectorXd ratio =
            (solver.eigenvectors().transpose() * y).array() / solver.eigenvalues().array().sqrt();
        EXPECT_LE((ratio.array() - 1).abs().maxCoeff(), bound + 1e-12);
    }
}

TEST(StiffnessSeries, RefusesABoundThatCannotBeMet)
{
    const auto root = [](double x) { return std::sqrt(x); };
    const std::string said =
        refusal([&] { (void)StiffnessSeries::within(root, {.lower = 1e-3, .upper = 1e3}, 1e-9); });
    EXPECT_TRUE(contains(said, "cannot be met")) << said;
}

TEST(StrikeSlipFault, RefusesWrongParameters)
{
    const auto with = [](auto&& change) {
        StrikeSlipFault::Parameters p;
        change(p);
        return refusal([&] { (void)StrikeSlipFault(p); });
    };
    EXPECT_TRUE(
        contains(with([](auto& p) { p.elements = 0; }), "elements must be at least 1, got 0"));
    EXPECT_TRUE(contains(with([](auto& p) { p.side = -1; }), "side"));
    EXPECT_TRUE(contains(with([](auto& p) { p.poisson = 0.5; }), "poisson"));
    EXPECT_TRUE(contains(with([](auto& p) { p.overload = 0; }), "overload"));
    // Refused by the estimate, before anything of that size is made.
    const std::string large = with([](auto& p) { p.elements = 100'000; });
    EXPECT_TRUE(contains(large, "memory_limit")) << large;
    const std::string layers = with([](auto& p) {
        p.elements = 1000;
        p.medium = FaultMedium::half_space;
    });
    EXPECT_TRUE(contains(layers, "memory_limit")) << layers;
}

class KernelFile : public testing::Test {
protected:
    KernelFile()
        : file_(fs::temp_directory_path() / ("ricochet-kernel-" + std::to_string(getpid())))
    {
    }
    ~KernelFile() override { fs::remove(file_); }

    std::string refusal_of(const Eigen::MatrixXd& m, int elements) const
    {
        std::string header = "{'descr': '<f8', 'fortran_order': True, 'shape': (" +
                             std::to_string(m.rows()) + ", " + std::to_string(m.cols()) + "), }";
        header.resize(118, ' ');
        std::ofstream out(file_, std::ios::binary);
        out << "\x93NUMPY" << '\x01' << '\0' << static_cast<char>(header.size()) << '\0' << header;
        out.write(reinterpret_cast<const char*>(m.data()),
                  static_cast<std::streamsize>(sizeof(double)) * m.size());
        out.close();
        return refusal([&] { (void)StrikeSlipFault({.elements = elements, .kernel = file_}); });
    }
    std::string refusal_of_bytes(const std::string& bytes) const
    {
        std::ofstream(file_, std::ios::binary) << bytes;
        return refusal([&] { (void)read_npy_square(file_); });
    }

    fs::path file_;
};

TEST_F(KernelFile, ThatFitsIsTaken)
{
    EXPECT_EQ(refusal_of(-Eigen::MatrixXd::Identity(4, 4), 2), "accepted");
}

TEST_F(KernelFile, ThatDoesNotFitIsRefused)
{
    Eigen::MatrixXd m = -Eigen::MatrixXd::Identity(4, 4);
    EXPECT_TRUE(contains(refusal_of(m, 3), "needs a kernel of 9 x 9 entries, got 4 x 4"));
    m(0, 1) = 0.1;
    EXPECT_TRUE(contains(refusal_of(m, 2), "must be symmetric"));
    EXPECT_TRUE(contains(refusal_of(Eigen::MatrixXd::Identity(4, 4), 2), "negative definite"));
    m.setConstant(-1);
    EXPECT_TRUE(contains(refusal_of(m, 2), "positive definite"));
    m(2, 2) = std::nan("");
    EXPECT_TRUE(contains(refusal_of(m, 2), "not numbers"));
    EXPECT_TRUE(contains(refusal_of(Eigen::MatrixXd::Zero(2, 3), 1), "square"));
}

TEST_F(KernelFile, OfSafetensorsIsReadAsNumPysIs)
{
    const auto with = [this](const std::string& header, std::size_t numbers) {
        std::string bytes(8, '\0');
        bytes[0] = static_cast<char>(header.size());
        bytes += header;
        for (std::size_t i = 0; i < numbers; ++i) {
            const auto number = static_cast<float>(i + 1);
            bytes += std::string(reinterpret_cast<const char*>(&number), sizeof number);
        }
        std::ofstream(file_, std::ios::binary) << bytes;
        Eigen::MatrixXd found;
        const std::string message = refusal([&] { found = read_safetensors_square(file_); });
        return std::pair(message, found);
    };
    const auto [message, matrix] =
        with(R"({"kernel":{"dtype":"F32","shape":[2,2],"data_offsets":[0,16]}})", 4);
    EXPECT_EQ(message, "accepted");
    EXPECT_EQ(matrix, (Eigen::Matrix2d{{1, 2}, {3, 4}}));  // by rows
    EXPECT_TRUE(
        contains(with(R"({"kernel":{"dtype":"F32","shape":[4],"data_offsets":[0,16]}})", 4).first,
                 "expected a square matrix, found shape [4]"));
    EXPECT_TRUE(
        contains(with(R"({"kernel":{"dtype":"F32","shape":[2,2],"data_offsets":[0,16]}})", 3).first,
                 "a range within 12 bytes of data"));
    EXPECT_TRUE(contains(with("{}", 0).first, "expected one tensor, found 0"));
    EXPECT_TRUE(contains(with("nonsense", 0).first, "expected JSON"));
    std::ofstream(file_, std::ios::binary) << "short";
    EXPECT_TRUE(
        contains(refusal([&] { (void)read_safetensors_square(file_); }), "ends before its header"));
    const fs::path named = file_.string() + ".safetensors";
    std::ofstream(named, std::ios::binary) << "short";
    EXPECT_TRUE(contains(refusal([&] { (void)read_kernel(named); }), "ends before its header"));
    fs::remove(named);
}

TEST_F(KernelFile, WhoseHeaderSaysOtherThingsIsRefused)
{
    const auto with = [this](std::string header) {
        header.resize(118, ' ');
        const double one = -1;
        std::string bytes("\x93NUMPY\x01\0\x76\0", 10);
        bytes += header + std::string(reinterpret_cast<const char*>(&one), sizeof one);
        return refusal_of_bytes(bytes);
    };
    EXPECT_EQ(with("{'descr': '<f8', 'fortran_order': False, 'shape': (1, 1), }"), "accepted");
    EXPECT_EQ(with("{'descr': '<f8', 'fortran_order': True , 'shape': (1, 1), }"), "accepted");
    for (const char* order : {"maybe", "1", "'True'", "true", "", "FalseTrue"}) {
        EXPECT_TRUE(contains(with(std::string("{'descr': '<f8', 'fortran_order': ") + order +
                                  ", 'shape': (1, 1), }"),
                             "True or False"))
            << order;
    }
    EXPECT_TRUE(contains(with("{'descr': '<f8', 'descr': '<f4', 'fortran_order': False, "
                              "'shape': (1, 1), }"),
                         "appears twice"));
    EXPECT_TRUE(
        contains(with("'descr': '<f8', 'fortran_order': False, 'shape': (1, 1), "), "in braces"));
    EXPECT_TRUE(contains(refusal([] { (void)read_npy_square("/dev/zero"); }), "something else"));
}

TEST_F(KernelFile, ThatIsNoneIsRefused)
{
    EXPECT_TRUE(contains(refusal_of_bytes("nonsense, no matrix"), "no NumPy file"));
    EXPECT_TRUE(contains(refusal_of_bytes(std::string("\x93NUMPY\x01\0\xff\xff{", 11) + "  "),
                         "ends within its header"));
    EXPECT_TRUE(
        contains(refusal([] { (void)read_npy_square("/nowhere/k.npy"); }), "cannot be read"));
    std::string cut;
    {
        std::ifstream in(kernels / "fault-kernel-10x10-3km.npy", std::ios::binary);
        cut.assign(std::istreambuf_iterator<char>(in), {});
    }
    cut.resize(cut.size() - 1);
    EXPECT_TRUE(contains(refusal_of_bytes(cut), "80000 bytes, found 79999"));
}

TEST(Rupture, OneElementHasTheKnownSlipArrestAndPeak)
{
    // The value was computed once to 1e-12 as a smooth equation up to the arrest.
    const Rupture r = simulate(StrikeSlipFault(), {.t_end = 30});
    EXPECT_EQ(r.outcome, Outcome::at_rest);
    EXPECT_EQ(r.t, 30);
    EXPECT_NEAR(r.mean_slip, 0.22799875, 1e-7);
    EXPECT_NEAR(r.arrest_time, 12.683187, 1e-6);
    EXPECT_EQ(r.rest_time, r.arrest_time);
    EXPECT_NEAR(r.peak_velocity, 0.0684778, 1e-7);
    EXPECT_NEAR(r.peak_time, 10.43650, 1e-5);
    EXPECT_EQ(r.statistics.arrests, 1U);
}

TEST(Rupture, AnElementThatTurnsBackKeepsTheOrderOfArrests)
{
    // Undamped and with hardly any weakening, one element makes half turns of a spring about the
    // friction of their direction: b (5 + 3 + 1) twice, in the time 3 pi, from an overload of 5.
    const StrikeSlipFault fault(
        {.damping = 0, .residual_friction = 0.5, .friction_drop = 1e-12, .overload = 5});
    const double b = fault.strength(0, 0);
    const double pi = std::numbers::pi;
    const auto rupture = [&](double step) {
        const double unit = fault.time_unit();
        return simulate(fault, {.t_end = 20 * unit,
                                .step = step * unit,
                                .rtol = std::numeric_limits<double>::infinity(),
                                .snapshot_times = {1.3 * pi * unit, 1.7 * pi * unit}});
    };
    for (const double step : {0.2, 0.1, 0.05}) {
        const Rupture r = rupture(step);
        EXPECT_EQ(r.outcome, Outcome::at_rest);
        EXPECT_EQ(r.statistics.arrests, 3U);
        EXPECT_EQ(r.statistics.restarts, 2U);
        const double allowed = 0.05 * step * step;
        EXPECT_NEAR(r.mean_slip / (18 * b * fault.slip_unit()), 1, allowed) << step;
        EXPECT_NEAR(r.rest_time / (3 * pi * fault.time_unit()), 1, allowed) << step;
        ASSERT_EQ(r.snapshots.size(), 2U);
        for (const RuptureSnapshot& s : r.snapshots) {
            const double turned = s.t / fault.time_unit() - pi;
            const double slip = b * (10 + 3 * (1 - std::cos(turned)));
            const double velocity = -3 * b * std::sin(turned);
            EXPECT_NEAR(s.slip[0] / fault.slip_unit(), slip, allowed * 10 * b) << step;
            EXPECT_NEAR(s.velocity[0] / fault.velocity_unit(), velocity, allowed * 10 * b) << step;
        }
    }
}

TEST(Rupture, EndsAtRestHoweverLateItsEnd)
{
    // The shortest step is relative to the time reached, and not to the end of the run.
    const StrikeSlipFault fault({.slip_distance = 1e-6});
    const Rupture early = simulate(fault, {.t_end = 30});
    const Rupture late = simulate(fault, {.t_end = 1e14});
    EXPECT_GT(early.statistics.rejected, 0U);
    EXPECT_EQ(late.outcome, Outcome::at_rest);
    EXPECT_EQ(late.mean_slip, early.mean_slip);
    EXPECT_EQ(late.rest_time, early.rest_time);
}

TEST(Rupture, PublishedKernelsGiveTheirConvergedSlip)
{
    // Limits of steps going to zero: 237.0438 and 825.2032 mm.
    const Rupture small = simulate(
        StrikeSlipFault({.elements = 10, .kernel = kernels / "fault-kernel-10x10-3km.npy"}),
        {.t_end = 30});
    EXPECT_NEAR(small.mean_slip, 0.2370438, 5e-6);
    EXPECT_NEAR(small.peak_velocity, 0.0712653, 1e-6);
    EXPECT_NEAR(small.peak_time, 8.5493, 1e-3);
    const Rupture large = simulate(
        StrikeSlipFault(
            {.elements = 10, .side = 5000, .kernel = kernels / "fault-kernel-10x10-5km.npy"}),
        {.t_end = 50});
    EXPECT_NEAR(large.mean_slip, 0.8252032, 1e-5);
    EXPECT_NEAR(large.peak_velocity, 0.194085, 1e-6);
}

TEST(Rupture, IsOfOrderFiveBeforeTheFirstArrestAndTwoAfterIt)
{
    const StrikeSlipFault fault({.elements = 4});
    const auto slip = [&](double t_end, double step) {
        return simulate(fault, {.t_end = t_end,
                                .step = step,
                                .rtol = std::numeric_limits<double>::infinity(),
                                .polynomial_bound = 1e-10})
            .mean_slip;
    };
    // Halving divides the error by 32, and more than 2^3.5 where the next term counts.
    const double before = slip(7, 0.02);
    EXPECT_GT(std::abs(slip(7, 0.5) - before) / std::abs(slip(7, 0.25) - before), 11.3);
    // Over four halvings, since single ratios are irregular: at least 2^(4 * 1.6) in all.
    const double after = slip(30, 0.0078125 / 4);
    EXPECT_GT(std::abs(slip(30, 0.25) - after) / std::abs(slip(30, 0.015625) - after), 84);
}

TEST(Rupture, EndsWhereItIsToldAndKeepsSnapshots)
{
    const StrikeSlipFault fault({.elements = 5});
    const Rupture r = simulate(
        fault,
        {.t_end = 8, .snapshot_times = {0, 3.3, 8}, .progress = [](double) { return true; }});
    EXPECT_EQ(r.outcome, Outcome::reached_end);
    EXPECT_EQ(r.t, 8);
    EXPECT_TRUE(std::isnan(r.rest_time));
    ASSERT_EQ(r.snapshots.size(), 3U);
    EXPECT_EQ(r.snapshots[0].slip.norm(), 0);
    EXPECT_NEAR((r.snapshots[2].slip - r.slip).norm(), 0, 1e-12);
    // A run that ends at a snapshot has the same fields, up to its own steps' errors.
    const Rupture early = simulate(fault, {.t_end = 3.3});
    EXPECT_NEAR((r.snapshots[1].velocity - early.velocity).norm() / early.velocity.norm(), 0, 1e-5);
    const Rupture cancelled =
        simulate(fault, {.t_end = 8, .progress = [](double t) { return t < 1; }});
    EXPECT_EQ(cancelled.outcome, Outcome::cancelled);
    EXPECT_LT(cancelled.t, 2);
}

TEST(Rupture, ThatTakesAllItsStepsStillReachesItsEnd)
{
    const StrikeSlipFault fault({.elements = 2});
    const auto expect_same_end = [&](RuptureOptions options, const auto&... how) {
        const Rupture free = simulate(fault, options, how...);
        options.max_steps = free.statistics.steps;
        const Rupture bound = simulate(fault, options, how...);
        EXPECT_EQ(bound.outcome, free.outcome);
        EXPECT_EQ(bound.t, free.t);
        --options.max_steps;
        const Rupture cut = simulate(fault, options, how...);
        EXPECT_EQ(cut.outcome, Outcome::step_limit);
        EXPECT_EQ(cut.statistics.steps, options.max_steps);
    };
    for (const double t_end : {8.0, 1000.0}) {
        expect_same_end({.t_end = t_end});
        expect_same_end({.t_end = t_end, .step = 0.125}, BatheOptions{});
    }
}

TEST(Rupture, HasTheSnapshotOfItsEndForAnyUnitOfTime)
{
    for (int i = 0; i < 50; ++i) {
        const StrikeSlipFault fault({.side = 1000 + 37.3 * i});
        const double end = 1 + 0.1 * i;
        const RuptureOptions options{.t_end = end, .step = 0.2, .snapshot_times = {end}};
        const RateStateRupture slow = simulate(fault, options, FaultFriction{}, {});
        for (const Rupture& r :
             {simulate(fault, options), simulate(fault, options, BatheOptions{}), slow.rupture}) {
            EXPECT_EQ(r.t, end) << i;
            ASSERT_EQ(r.snapshots.size(), 1U) << i;
            EXPECT_NEAR(r.snapshots[0].slip[0] / r.slip[0], 1, 1e-12) << i;
        }
    }
}

TEST(Rupture, IsSymmetricAlongTheStrike)
{
    const Rupture r = simulate(StrikeSlipFault({.elements = 6}), {.t_end = 30});
    for (Eigen::Index z = 0; z < 6; ++z) {
        for (Eigen::Index x = 0; x < 3; ++x) {
            EXPECT_NEAR(r.slip[6 * z + x], r.slip[6 * z + 5 - x], 1e-9);
        }
    }
}

TEST(Rupture, RefusesWrongOptions)
{
    const StrikeSlipFault fault;
    const auto said = [&](const RuptureOptions& options) {
        return refusal([&] { (void)simulate(fault, options); });
    };
    EXPECT_TRUE(contains(said({}), "t_end"));
    EXPECT_TRUE(contains(said({.t_end = 1, .step = -1}), "step"));
    EXPECT_TRUE(contains(said({.t_end = 1, .rtol = 0}), "rtol"));
    EXPECT_TRUE(contains(said({.t_end = 1, .polynomial_bound = -1}), "polynomial_bound"));
    EXPECT_TRUE(contains(said({.t_end = 1, .snapshot_times = {2}}), "snapshot_times"));
    const StrikeSlipFault large({.elements = 10});
    EXPECT_TRUE(
        contains(refusal([&] { (void)simulate(large, {.t_end = 1, .polynomial_bound = 1e-18}); }),
                 "cannot be met"));
}

TEST(Rupture, StabilityOfTheMethodIsKnown)
{
    // Dormand and Prince's interval on the negative axis ends at 3.31; at 0.8/3 near 3.15.
    EXPECT_NEAR(stable_step_of_mode(1), 3.31, 0.01);
    EXPECT_NEAR(stable_step_of_mode(0.8 / 3), 3.15, 0.02);
    // Strong damping has one fast mode, of rate -2 zeta.
    for (const double damping : {30.0, 2e3, 1e6, 1e200}) {
        EXPECT_NEAR(2 * damping * stable_step_of_mode(damping), 3.31, 0.01) << damping;
    }
    // At a damping of 2e3 an element creeps at (1 + overload) b - b(s) - d - 4e3 v = 0.
    const StrikeSlipFault fault({.damping = 2e3, .friction_drop = 1e-12, .overload = 1});
    const Rupture r = simulate(fault, {.t_end = 100 * fault.time_unit()});
    EXPECT_EQ(r.outcome, Outcome::reached_end);
    const double creep = -std::expm1(-100 / 4e3);
    EXPECT_NEAR(r.mean_slip / (fault.strength(0, 0) * fault.slip_unit()) / creep, 1, 1e-5);
}

TEST(Rupture, FrictionThatFallsWithinMicrometresTakesShorterSteps)
{
    // The peak is that of friction without its drop, after an onset that needs short steps.
    for (const double distance : {1e-7, 1e-8, 1e-10}) {
        const Rupture r =
            simulate(StrikeSlipFault({.slip_distance = distance, .overload = 1e-2}), {.t_end = 30});
        EXPECT_EQ(r.outcome, Outcome::at_rest) << distance;
        EXPECT_NEAR(r.arrest_time, 2.8229, 0.02) << distance;
    }
}

Rupture bathe(const StrikeSlipFault& fault, double step, const BatheOptions& options = {})
{
    return simulate(fault, {.t_end = 30, .step = step, .polynomial_bound = 1e-7}, options);
}

TEST(FaultBathe, PublishedSchemeGivesThePublishedSlips)
{
    // Values of the source's own code, with its stages solved to the last digit: 234.268 and
    // 229.058 mm, 243.671 and 238.089 mm.
    const StrikeSlipFault one;
    const StrikeSlipFault hundred(
        {.elements = 10, .kernel = kernels / "fault-kernel-10x10-3km.npy"});
    const BatheOptions published{.first_stage = FirstStage::at_end};
    EXPECT_NEAR(bathe(one, 0.5, published).mean_slip, 0.234268, 1e-6);
    EXPECT_NEAR(bathe(one, 0.1, published).mean_slip, 0.229058, 1e-6);
    EXPECT_NEAR(bathe(hundred, 0.5, published).mean_slip, 0.243671, 1e-6);
    EXPECT_NEAR(bathe(hundred, 0.1, published).mean_slip, 0.238089, 1e-6);
    // With the controller of the source: 237.72 mm, and 237.67 with its own loosely solved stages.
    const Rupture controlled = bathe(hundred, 0.05,
                                     {.first_stage = FirstStage::at_end,
                                      .controller = ClassicStep{.order = 1, .up = 1.8},
                                      .estimate = ErrorEstimate::doubling,
                                      .norm = FaultNorm::components});
    EXPECT_NEAR(controlled.mean_slip, 0.23772, 1e-4);
    EXPECT_GT(controlled.statistics.rejected, 0U);
}

TEST(FaultBathe, AveragedSchemeIsOfOrderTwoThroughAllArrests)
{
    const StrikeSlipFault fault({.elements = 10, .kernel = kernels / "fault-kernel-10x10-3km.npy"});
    const double exact = 0.2370438;
    for (const FaultBound bound : {FaultBound::implicit, FaultBound::extrapolated}) {
        double before = 0;
        for (const double step : {0.5, 0.25, 0.125, 0.0625}) {
            const Rupture r = bathe(fault, step, {.bound = bound});
            EXPECT_EQ(r.outcome, Outcome::at_rest);
            EXPECT_EQ(r.statistics.arrests, 100U);
            const double error = std::abs(r.mean_slip - exact);
            // 4 for each halving, approximately, since a step's end may fall beside an arrest.
            if (before > 0) {
                EXPECT_NEAR(before / error, 4, 0.5) << step;
            }
            before = error;
        }
    }
}

TEST(FaultBathe, FreeEstimateControlsTheError)
{
    const StrikeSlipFault fault({.elements = 4});
    const double exact = simulate(fault, {.t_end = 30, .step = 0.01}).mean_slip;
    double before = 1;
    for (const double rtol : {1e-1, 1e-2, 1e-3}) {
        const Rupture r = bathe(fault, 0.05,
                                {.controller = ErrorStep{.order = 3, .reject_above = 100},
                                 .estimate = ErrorEstimate::embedded,
                                 .rtol = rtol});
        const double error = std::abs(r.mean_slip / exact - 1);
        // At least half an order for each order of the tolerance: the error falls with its power
        // 2/3.
        EXPECT_LT(error, before / 2) << rtol;
        before = error;
    }
    EXPECT_LT(before, 1e-3);
}

TEST(FaultBathe, StepsBeyondConvexityAreReportedOrShortened)
{
    // Convex below 1.5 s; a constant step of 6 s is halved until its stages have solutions.
    const Rupture r = bathe(StrikeSlipFault({.elements = 3}), 6);
    EXPECT_GT(r.statistics.rejected, 0U);
    EXPECT_TRUE(r.outcome == Outcome::at_rest || r.outcome == Outcome::reached_end ||
                r.outcome == Outcome::not_converged);
    EXPECT_TRUE(r.slip.allFinite());
    // With the bound extrapolated every stage is convex.
    const Rupture extrapolated =
        bathe(StrikeSlipFault({.elements = 3}), 3, {.bound = FaultBound::extrapolated});
    EXPECT_EQ(extrapolated.statistics.rejected, 0U);
}

TEST(FaultBathe, AnOverloadBelowRoundingStillRuptures)
{
    // The onset grows from any overload: the slip is the same, only later, as with explicit steps.
    for (const double overload : {1e-16, 1e-17, 1e-40}) {
        const StrikeSlipFault fault({.overload = overload});
        const double peak = simulate(fault, {.t_end = 150}).peak_time;
        for (const FirstStage first : {FirstStage::averaged, FirstStage::at_end}) {
            const Rupture r = simulate(fault, {.t_end = 150, .step = 0.02}, {.first_stage = first});
            EXPECT_EQ(r.outcome, Outcome::at_rest) << overload;
            EXPECT_NEAR(r.mean_slip, 0.22797, 1e-3) << overload;
            EXPECT_NEAR(r.peak_time / peak, 1, 5e-3) << overload;
        }
        const Rupture controlled = simulate(
            fault, {.t_end = 150, .step = 0.02},
            {.controller = ErrorStep{}, .estimate = ErrorEstimate::embedded, .rtol = 1e-4});
        EXPECT_EQ(controlled.outcome, Outcome::at_rest) << overload;
        EXPECT_NEAR(controlled.mean_slip, 0.22797, 1e-4) << overload;
    }
}

TEST(FaultBathe, RefusesWrongOptions)
{
    const StrikeSlipFault fault;
    const auto said = [&](const BatheOptions& options, double step = 0.1) {
        return refusal([&] { (void)bathe(fault, step, options); });
    };
    EXPECT_TRUE(contains(said({}, 0), "step must be positive"));
    EXPECT_TRUE(contains(said({.first_stage = FirstStage::switch_aware}), "averaged or at_end"));
    EXPECT_TRUE(contains(said({.controller = HeuristicStep{}}), "estimate"));
    EXPECT_TRUE(contains(said({.first_stage = FirstStage::at_end,
                               .controller = ErrorStep{},
                               .estimate = ErrorEstimate::embedded}),
                         "averaged"));
    EXPECT_TRUE(contains(said({.rtol = -1}), "rtol"));
}

}  // namespace
}  // namespace ricochet::fault_test
