// What two models of ns-3.44 say by themselves: error rates of OFDM, and Jakes' fading in time.
//
// `errors`: for each model, rate and size a line `model rate bytes from step share share ...`: shares of frames that
// arrive, over SINR from -4 to 26 dB. `jakes`: for each run the power gains of one pair at rest, `samples` of them `step`
// apart, and between two of them, at the same instant, whether the way back has the same gain (1 or 0, last on its line).
//
// Not part of the product; ns-3 links under its own licence.
#include "ns3/core-module.h"
#include "ns3/mobility-module.h"
#include "ns3/propagation-module.h"
#include "ns3/wifi-module.h"

#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

using namespace ns3;

static void
Errors()
{
    const double from = -4, step = 0.25;
    for (std::string name : {"Nist", "TableBased"})
    {
        ObjectFactory factory("ns3::" + name + "ErrorRateModel");
        Ptr<ErrorRateModel> model = factory.Create<ErrorRateModel>();
        for (std::string rate : {"6", "9", "12", "18", "24", "36", "48", "54"})
        {
            WifiMode mode("OfdmRate" + rate + "Mbps");
            WifiTxVector vector;
            vector.SetMode(mode);
            vector.SetChannelWidth(20);
            for (uint64_t bytes : {100, 1000})
            {
                std::printf("%s %s %lu %g %g", name.c_str(), rate.c_str(), bytes, from, step);
                for (double db = from; db <= 26; db += step)
                    std::printf(" %.6g", model->GetChunkSuccessRate(mode, vector, std::pow(10, db / 10), 8 * bytes));
                std::printf("\n");
            }
        }
    }
}

static Ptr<JakesPropagationLossModel> g_jakes;
static std::vector<Ptr<MobilityModel>> g_ends;
static bool g_both_ways = true;

static void
Sample()
{
    const double there = g_jakes->CalcRxPower(0, g_ends[0], g_ends[1]);
    g_both_ways &= there == g_jakes->CalcRxPower(0, g_ends[1], g_ends[0]);
    std::printf("%.5g ", std::pow(10, there / 10));
}

static void
Jakes(double doppler, double step, uint32_t samples, uint32_t runs)
{
    Config::SetDefault("ns3::JakesProcess::DopplerFrequencyHz", DoubleValue(doppler));
    for (uint32_t run = 1; run <= runs; ++run)
    {
        RngSeedManager::SetRun(run);
        g_jakes = CreateObject<JakesPropagationLossModel>();
        g_ends = {CreateObject<ConstantPositionMobilityModel>(), CreateObject<ConstantPositionMobilityModel>()};
        g_ends[1]->SetPosition(Vector(100, 0, 0));
        g_both_ways = true;
        for (uint32_t i = 0; i < samples; ++i)
            Simulator::Schedule(Seconds(i * step), &Sample);
        Simulator::Run();
        Simulator::Destroy();
        std::printf("%d\n", g_both_ways);
    }
}

int
main(int argc, char** argv)
{
    std::string what = "errors";
    double doppler = 8, step = 0.005;
    uint32_t samples = 200, runs = 300;
    CommandLine cmd;
    cmd.AddValue("what", "errors or jakes", what);
    cmd.AddValue("doppler", "[Hz]", doppler);
    cmd.AddValue("step", "[s]", step);
    cmd.AddValue("samples", "of each run", samples);
    cmd.AddValue("runs", "pairs", runs);
    cmd.Parse(argc, argv);
    if (what == "errors")
        Errors();
    else
        Jakes(doppler, step, samples, runs);
    g_jakes = nullptr;
    g_ends.clear();
    return 0;
}
