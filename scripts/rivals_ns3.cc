// AODV and OLSR of ns-3 under the conditions of scenario `rivals`, to set beside scripts/rivals.py: with ns-3's ARP, or
// with all addresses known from the start. One line per run: PDR, conn, and the delay's mean, median and p95 in ms,
// and the hops of what was delivered.
//
// Not part of the product. Written for ns-3.37 as Debian packages it (libns3-dev); ns-3 links under its own licence.
//
//   g++ -std=c++17 -O1 scripts/rivals_ns3.cc -o rivals_ns3 -lns3-aodv -lns3-olsr -lns3-internet -lns3-wifi (one line)
//     -lns3-mobility -lns3-propagation -lns3-network -lns3-core
//   for run in $(seq 10); do ./rivals_ns3 --proto=aodv --speed=10 --arp=false --run=$run; done
#include "ns3/aodv-module.h"
#include "ns3/core-module.h"
#include "ns3/internet-module.h"
#include "ns3/mobility-module.h"
#include "ns3/network-module.h"
#include "ns3/olsr-module.h"
#include "ns3/wifi-module.h"

#include <algorithm>
#include <cstring>
#include <iostream>
#include <vector>

using namespace ns3;

static std::vector<double> g_delays;
static uint64_t g_sent = 0, g_reached = 0, g_asked = 0, g_hops = 0;
static NodeContainer g_nodes;

static void
Arrive(Ptr<Socket> socket)
{
    while (Ptr<Packet> p = socket->Recv())
    {
        int64_t born;
        p->CopyData(reinterpret_cast<uint8_t*>(&born), sizeof(born));
        SocketIpTtlTag ttl;
        p->PeekPacketTag(ttl);
        g_hops += 65 - ttl.GetTtl();
        g_delays.push_back((Simulator::Now().GetNanoSeconds() - born) / 1e6);
    }
}

static void
Send(Ptr<Socket> socket, uint32_t left)
{
    uint8_t bytes[1024] = {};
    int64_t born = Simulator::Now().GetNanoSeconds();
    std::memcpy(bytes, &born, sizeof(born));
    socket->Send(Create<Packet>(bytes, sizeof(bytes)));
    ++g_sent;
    if (left > 1)
    {
        Simulator::Schedule(Seconds(1), &Send, socket, left - 1);
    }
}

static void
Connected(uint32_t left)
{
    uint32_t n = g_nodes.GetN();
    std::vector<Vector> at;
    for (uint32_t i = 0; i < n; ++i)
    {
        at.push_back(g_nodes.Get(i)->GetObject<MobilityModel>()->GetPosition());
    }
    std::vector<uint32_t> ring{0};
    std::vector<bool> known(n, false);
    known[0] = true;
    while (!ring.empty())
    {
        uint32_t a = ring.back();
        ring.pop_back();
        for (uint32_t b = 0; b < n; ++b)
        {
            if (!known[b] && CalculateDistance(at[a], at[b]) <= 250)
            {
                known[b] = true;
                ring.push_back(b);
            }
        }
    }
    g_reached += std::count(known.begin(), known.end(), true) - 1;
    g_asked += n - 1;
    if (left > 1)
    {
        Simulator::Schedule(Seconds(1), &Connected, left - 1);
    }
}

int
main(int argc, char** argv)
{
    std::string proto = "aodv";
    double speed = 10, warmup = 15;
    uint32_t run = 1, seconds = 90;
    bool arp = true;
    CommandLine cmd;
    cmd.AddValue("proto", "aodv or olsr", proto);
    cmd.AddValue("speed", "m/s", speed);
    cmd.AddValue("warmup", "s before traffic", warmup);
    cmd.AddValue("run", "seed", run);
    cmd.AddValue("arp", "resolve addresses; false: they are known from the start", arp);
    cmd.Parse(argc, argv);
    RngSeedManager::SetRun(run);

    g_nodes.Create(45);
    Ptr<ListPositionAllocator> grid = CreateObject<ListPositionAllocator>();
    grid->Add(Vector(1250, 1250, 0));
    for (int y = -2; y <= 2; ++y)
    {
        for (int x = -4; x <= 4; ++x)
        {
            if (x || y)
            {
                grid->Add(Vector(1250 + 200 * x, 1250 + 200 * y, 0));
            }
        }
    }
    MobilityHelper mobility;
    mobility.SetPositionAllocator(grid);
    mobility.SetMobilityModel("ns3::ConstantPositionMobilityModel");
    if (speed > 0)
    {
        mobility.Install(g_nodes.Get(0));
        ObjectFactory area;
        area.SetTypeId("ns3::RandomRectanglePositionAllocator");
        area.Set("X", StringValue("ns3::UniformRandomVariable[Min=0|Max=2500]"));
        area.Set("Y", StringValue("ns3::UniformRandomVariable[Min=0|Max=2500]"));
        std::ostringstream constant;
        constant << "ns3::ConstantRandomVariable[Constant=" << speed << "]";
        mobility.SetMobilityModel("ns3::RandomWaypointMobilityModel", "Speed", StringValue(constant.str()), "Pause",
                                  StringValue("ns3::ConstantRandomVariable[Constant=0]"), "PositionAllocator",
                                  PointerValue(area.Create()->GetObject<PositionAllocator>()));
        for (uint32_t i = 1; i < 45; ++i)
        {
            mobility.Install(g_nodes.Get(i));
        }
    }
    else
    {
        mobility.Install(g_nodes);
    }

    WifiHelper wifi;
    wifi.SetStandard(WIFI_STANDARD_80211b);
    wifi.SetRemoteStationManager("ns3::ConstantRateWifiManager", "DataMode", StringValue("DsssRate11Mbps"),
                                 "ControlMode", StringValue("DsssRate11Mbps"), "NonUnicastMode",
                                 StringValue("DsssRate11Mbps"));
    YansWifiChannelHelper channel;
    channel.SetPropagationDelay("ns3::ConstantSpeedPropagationDelayModel");
    channel.AddPropagationLoss("ns3::RangePropagationLossModel", "MaxRange", DoubleValue(250));
    YansWifiPhyHelper phy;
    phy.SetChannel(channel.Create());
    WifiMacHelper mac;
    mac.SetType("ns3::AdhocWifiMac");
    NetDeviceContainer devices = wifi.Install(phy, mac, g_nodes);

    InternetStackHelper stack;
    AodvHelper aodv;
    OlsrHelper olsr;
    if (proto == "aodv")
    {
        stack.SetRoutingHelper(aodv);
    }
    else
    {
        stack.SetRoutingHelper(olsr);
    }
    stack.Install(g_nodes);
    Ipv4AddressHelper addresses;
    addresses.SetBase("10.0.0.0", "255.255.255.0");
    Ipv4InterfaceContainer at = addresses.Assign(devices);
    for (uint32_t i = 0; !arp && i < 45; ++i)
    {
        // permanent, not NeighborCacheHelper's "autogenerated": AODV's layer 2 feedback knows only the former
        Ptr<ArpCache> cache = g_nodes.Get(i)->GetObject<Ipv4L3Protocol>()->GetInterface(1)->GetArpCache();
        for (uint32_t j = 0; j < 45; ++j)
        {
            if (j != i)
            {
                ArpCache::Entry* entry = cache->Add(at.GetAddress(j));
                entry->SetMacAddress(devices.Get(j)->GetAddress());
                entry->MarkPermanent();
            }
        }
    }

    Ptr<Socket> sink = Socket::CreateSocket(g_nodes.Get(0), UdpSocketFactory::GetTypeId());
    sink->Bind(InetSocketAddress(Ipv4Address::GetAny(), 9));
    sink->SetIpRecvTtl(true);
    sink->SetRecvCallback(MakeCallback(&Arrive));
    Ptr<UniformRandomVariable> phase = CreateObject<UniformRandomVariable>();
    for (uint32_t i = 1; i < 45; ++i)
    {
        Ptr<Socket> source = Socket::CreateSocket(g_nodes.Get(i), UdpSocketFactory::GetTypeId());
        source->Connect(InetSocketAddress(at.GetAddress(0), 9));
        Simulator::ScheduleWithContext(i, Seconds(warmup + phase->GetValue(0, 1)), &Send, source, seconds);
    }
    Simulator::Schedule(Seconds(warmup), &Connected, seconds);
    Simulator::Stop(Seconds(warmup + seconds + 2));
    Simulator::Run();
    std::sort(g_delays.begin(), g_delays.end());
    double sum = 0;
    for (double d : g_delays)
    {
        sum += d;
    }
    size_t n = g_delays.size();
    std::cout << double(n) / g_sent << " " << double(g_reached) / g_asked << " " << (n ? sum / n : 0) << " "
              << (n ? g_delays[n / 2] : 0) << " " << (n ? g_delays[size_t(0.95 * n)] : 0) << " "
              << (n ? double(g_hops) / n : 0) << std::endl;
    Simulator::Destroy();
    return 0;
}
