// The state of an exported FMU, kept, set again and serialized, through the functions of FMI 3.0.
#include <dlfcn.h>
#include <gtest/gtest.h>

#include <cstdint>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <vector>

#include "ricochet/fmi/fmu.hpp"

namespace ricochet::fmi::state_test {

namespace {

/// The library of an exported model.
class Library {
public:
    explicit Library(const std::string& name)
        : token_(Fmu(std::filesystem::path(RICOCHET_FMUS) / (name + ".fmu")).description().token),
          handle_(dlopen((std::string(RICOCHET_FMU_LIBRARIES) + "/" + name + ".so").c_str(),
                         RTLD_NOW | RTLD_LOCAL))
    {
        if (handle_ == nullptr) throw std::runtime_error(dlerror());
    }
    ~Library() { dlclose(handle_); }
    Library(const Library&) = delete;
    Library& operator=(const Library&) = delete;

    template <class F>
    [[nodiscard]] F function(const char* name) const
    {
        const auto found = reinterpret_cast<F>(dlsym(handle_, name));
        if (found == nullptr) throw std::runtime_error(name);
        return found;
    }
    [[nodiscard]] const std::string& token() const noexcept { return token_; }

private:
    std::string token_;
    void* handle_;
};

/// An instance for co-simulation without event mode, in step mode.
class Slave {
public:
    explicit Slave(const Library& library) : library_(&library)
    {
        using Make = void* (*)(const char*, const char*, const char*, bool, bool, bool, bool,
                               const std::uint32_t*, std::size_t, void*, void*, void*);
        c_ = library.function<Make>("fmi3InstantiateCoSimulation")(
            "s", library.token().c_str(), "", false, false, false, false, nullptr, 0, nullptr,
            nullptr, nullptr);
        if (c_ == nullptr) throw std::runtime_error("no instance");
        using Enter = int (*)(void*, bool, double, double, bool, double);
        if (library.function<Enter>("fmi3EnterInitializationMode")(c_, false, 0, 0, false, 0) ||
            plain("fmi3ExitInitializationMode")) {
            throw std::runtime_error("not initialized");
        }
    }
    ~Slave() { library_->function<void (*)(void*)>("fmi3FreeInstance")(c_); }
    Slave(const Slave&) = delete;
    Slave& operator=(const Slave&) = delete;

    int plain(const char* name) { return library_->function<int (*)(void*)>(name)(c_); }
    int step(double t, double h)
    {
        using Step = int (*)(void*, double, double, bool, bool*, bool*, bool*, double*);
        bool event = false, end = false, early = false;
        double reached = 0;
        return library_->function<Step>("fmi3DoStep")(c_, t, h, true, &event, &end, &early,
                                                      &reached);
    }
    [[nodiscard]] std::vector<double> values(std::vector<std::uint32_t> references) const
    {
        using Get = int (*)(void*, const std::uint32_t*, std::size_t, double*, std::size_t);
        std::vector<double> out(references.size());
        EXPECT_EQ(library_->function<Get>("fmi3GetFloat64")(
                      c_, references.data(), references.size(), out.data(), out.size()),
                  0);
        return out;
    }
    [[nodiscard]] std::vector<double> state() const { return values({0, 1, 2}); }

    void* save()
    {
        void* kept = nullptr;
        EXPECT_EQ(library_->function<int (*)(void*, void**)>("fmi3GetFMUState")(c_, &kept), 0);
        return kept;
    }
    int set(void* kept)
    {
        return library_->function<int (*)(void*, void*)>("fmi3SetFMUState")(c_, kept);
    }
    void free(void* kept)
    {
        library_->function<int (*)(void*, void**)>("fmi3FreeFMUState")(c_, &kept);
    }
    std::vector<std::uint8_t> serialized(void* kept)
    {
        std::size_t size = 0;
        using Size = int (*)(void*, void*, std::size_t*);
        EXPECT_EQ(library_->function<Size>("fmi3SerializedFMUStateSize")(c_, kept, &size), 0);
        std::vector<std::uint8_t> bytes(size);
        using Write = int (*)(void*, void*, std::uint8_t*, std::size_t);
        EXPECT_EQ(library_->function<Write>("fmi3SerializeFMUState")(c_, kept, bytes.data(), size),
                  0);
        return bytes;
    }
    int deserialize(const std::vector<std::uint8_t>& bytes, void** kept)
    {
        using Read = int (*)(void*, const std::uint8_t*, std::size_t, void**);
        return library_->function<Read>("fmi3DeserializeFMUState")(c_, bytes.data(), bytes.size(),
                                                                   kept);
    }

private:
    const Library* library_;
    void* c_ = nullptr;
};

class States : public testing::TestWithParam<const char*> {};
INSTANTIATE_TEST_SUITE_P(Fmi, States,
                         testing::Values("fmu_ball", "fmu_stick_slip", "fmu_oscillator"));

TEST_P(States, AStepThatIsRepeatedFromAKeptStateHasTheSameBits)
{
    const Library library(GetParam());
    Slave slave(library);
    double t = 0;
    for (int k = 0; k < 40; ++k, t += 0.25) {
        void* const kept = slave.save();
        ASSERT_EQ(slave.step(t, 0.25), 0);
        const std::vector<double> once = slave.state();
        ASSERT_EQ(slave.set(kept), 0);
        EXPECT_EQ(slave.state()[0], t);
        ASSERT_EQ(slave.step(t, 0.1), 0);  // a shorter one, thrown away
        ASSERT_EQ(slave.set(kept), 0);
        ASSERT_EQ(slave.step(t, 0.25), 0);
        EXPECT_EQ(slave.state(), once) << t;
        slave.free(kept);
    }
}

TEST_P(States, ASerializedStateGoesOnInAnotherInstance)
{
    const Library library(GetParam());
    Slave first(library), second(library);
    for (double t = 0; t < 5; t += 0.5) ASSERT_EQ(first.step(t, 0.5), 0);
    void* const kept = first.save();
    const std::vector<std::uint8_t> bytes = first.serialized(kept);
    first.free(kept);
    void* read = nullptr;
    ASSERT_EQ(second.deserialize(bytes, &read), 0);
    ASSERT_EQ(second.set(read), 0);
    second.free(read);
    for (double t = 5; t < 10; t += 0.5) {
        ASSERT_EQ(first.step(t, 0.5), 0);
        ASSERT_EQ(second.step(t, 0.5), 0);
        EXPECT_EQ(first.state(), second.state());
    }
}

TEST_P(States, BrokenBytesAreRefused)
{
    const Library library(GetParam());
    Slave slave(library);
    ASSERT_EQ(slave.step(0, 2), 0);
    void* const kept = slave.save();
    const std::vector<std::uint8_t> bytes = slave.serialized(kept);
    slave.free(kept);
    for (std::size_t at = 0; at < bytes.size(); at += 1 + bytes.size() / 50) {
        std::vector<std::uint8_t> broken = bytes;
        broken.resize(at);
        void* read = nullptr;
        EXPECT_NE(slave.deserialize(broken, &read), 0) << at;
        EXPECT_EQ(read, nullptr);
    }
    EXPECT_EQ(slave.step(2, 1), 0);
}

TEST(Instances, ThatAreCalledTooEarlyOrOfAnotherModelAreRefused)
{
    const Library ball("fmu_ball");
    Slave slave(ball);
    EXPECT_EQ(slave.plain("fmi3EnterContinuousTimeMode"), 3);
    EXPECT_EQ(slave.step(1, 1), 3);   // it stands at 0
    EXPECT_EQ(slave.step(0, -1), 3);  // backward
    EXPECT_EQ(slave.step(0, 1), 0);
    using Make = void* (*)(const char*, const char*, const char*, bool, bool, void*, void*);
    EXPECT_EQ(ball.function<Make>("fmi3InstantiateModelExchange")("s", "{another}", "", false,
                                                                  false, nullptr, nullptr),
              nullptr);
}

}  // namespace

}  // namespace ricochet::fmi::state_test
