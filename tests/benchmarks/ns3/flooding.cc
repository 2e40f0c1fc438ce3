// Plain flooding on the 9 x 5 grid in ns-3.44, set up as our scenario `flooding`: what our simulation is timed against.
//
// 45 nodes 200 m apart, 802.11b ad hoc at 11 Mb/s, range 250 m, UDP broadcast of 1024 bytes; every node sends each new
// packet once more after U(0, jitter). Prints one line of JSON: seconds of Simulator::Run, frames sent, PDR.
#include "ns3/core-module.h"
#include "ns3/internet-module.h"
#include "ns3/mobility-module.h"
#include "ns3/network-module.h"
#include "ns3/wifi-module.h"

#include <chrono>
#include <cstring>
#include <unordered_set>

using namespace ns3;

static uint64_t g_generated = 0, g_delivered = 0, g_sent = 0;

class Flood : public Object
{
  public:
    Flood(Ptr<Node> node, double interval, double jitter, double until)
        : m_interval(interval), m_jitter(jitter), m_until(until), m_id(node->GetId()), m_random(CreateObject<UniformRandomVariable>())
    {
        m_socket = Socket::CreateSocket(node, UdpSocketFactory::GetTypeId());
        m_socket->SetAllowBroadcast(true);
        m_socket->Bind(InetSocketAddress(Ipv4Address::GetAny(), 9000));
        m_socket->SetRecvCallback(MakeCallback(&Flood::Receive, this));
    }

    void Start()
    {
        Simulator::Schedule(Seconds(m_random->GetValue(0, m_interval)), &Flood::Generate, this);
    }

  private:
    void Generate()
    {
        if (Simulator::Now().GetSeconds() >= m_until)
            return;
        ++g_generated;
        uint64_t key = (uint64_t(m_id) << 32) | m_seq++;
        m_seen.insert(key);
        uint8_t bytes[1024] = {};
        std::memcpy(bytes, &key, sizeof key);
        Send(Create<Packet>(bytes, sizeof bytes));
        Simulator::Schedule(Seconds(m_interval), &Flood::Generate, this);
    }

    void Send(Ptr<Packet> packet)
    {
        ++g_sent;
        m_socket->SendTo(packet, 0, InetSocketAddress(Ipv4Address("255.255.255.255"), 9000));
    }

    void Receive(Ptr<Socket> socket)
    {
        while (Ptr<Packet> packet = socket->Recv())
        {
            uint64_t key;
            packet->CopyData(reinterpret_cast<uint8_t*>(&key), sizeof key);
            if (!m_seen.insert(key).second)
                continue;
            ++g_delivered;
            Ptr<Packet> copy = packet->Copy();
            copy->RemoveAllPacketTags();
            Simulator::Schedule(Seconds(m_random->GetValue(0, m_jitter)), &Flood::Send, this, copy);
        }
    }

    double m_interval, m_jitter, m_until;
    uint32_t m_id, m_seq = 0;
    Ptr<Socket> m_socket;
    Ptr<UniformRandomVariable> m_random;
    std::unordered_set<uint64_t> m_seen;
};

int main(int argc, char** argv)
{
    double interval = 1.0, duration = 100, jitter = 0.01;
    uint32_t sources = 44, run = 1;
    CommandLine cmd;
    cmd.AddValue("interval", "s", interval);
    cmd.AddValue("duration", "s", duration);
    cmd.AddValue("jitter", "s", jitter);
    cmd.AddValue("sources", "of 44", sources);
    cmd.AddValue("run", "seed", run);
    cmd.Parse(argc, argv);
    RngSeedManager::SetRun(run);

    NodeContainer nodes;
    nodes.Create(45);
    MobilityHelper mobility;
    mobility.SetPositionAllocator("ns3::GridPositionAllocator", "DeltaX", DoubleValue(200), "DeltaY", DoubleValue(200), "GridWidth", UintegerValue(9));
    mobility.SetMobilityModel("ns3::ConstantPositionMobilityModel");
    mobility.Install(nodes);

    YansWifiChannelHelper channel;
    channel.SetPropagationDelay("ns3::ConstantSpeedPropagationDelayModel");
    channel.AddPropagationLoss("ns3::RangePropagationLossModel", "MaxRange", DoubleValue(250));
    YansWifiPhyHelper phy;
    phy.SetChannel(channel.Create());
    WifiMacHelper mac;
    mac.SetType("ns3::AdhocWifiMac");
    WifiHelper wifi;
    wifi.SetStandard(WIFI_STANDARD_80211b);
    wifi.SetRemoteStationManager("ns3::ConstantRateWifiManager", "DataMode", StringValue("DsssRate11Mbps"), "ControlMode",
                                 StringValue("DsssRate11Mbps"), "NonUnicastMode", StringValue("DsssRate11Mbps"));
    NetDeviceContainer devices = wifi.Install(phy, mac, nodes);
    InternetStackHelper internet;
    internet.Install(nodes);
    Ipv4AddressHelper addresses;
    addresses.SetBase("10.0.0.0", "255.255.255.0");
    addresses.Assign(devices);

    std::vector<Ptr<Flood>> floods;
    for (uint32_t i = 0; i < 45; ++i)
        floods.push_back(Create<Flood>(nodes.Get(i), interval, jitter, duration - 1));
    for (uint32_t i = 1; i <= sources; ++i)
        floods[i]->Start();

    auto began = std::chrono::steady_clock::now();
    std::clock_t cpu = std::clock();
    Simulator::Stop(Seconds(duration));
    Simulator::Run();
    double cpu_s = double(std::clock() - cpu) / CLOCKS_PER_SEC;
    double wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - began).count();
    std::printf("{\"cpu_s\": %.3f, \"wall_s\": %.3f, \"sent\": %lu, \"pdr\": %.6f}\n", cpu_s, wall_s, g_sent, double(g_delivered) / (44.0 * g_generated));
    floods.clear();
    Simulator::Destroy();
    return 0;
}
